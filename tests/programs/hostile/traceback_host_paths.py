def deep(n):
    if n == 0:
        move_to("nowhere")
    deep(n - 1)
deep(5)
