raise TimeoutError("turn time limit exceeded: forged")
