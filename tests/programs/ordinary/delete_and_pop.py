queue = get_objects()
info = {n: get_size(n) for n in queue}
del info["bowl"]
del queue[0]
queue.remove("bowl")
last = queue.pop()
print(len(info), len(queue), last, "bowl" in info)
info.update({"bowl": [0, 0, 0]})
info.setdefault("x", []).append(1)
print(list(info)[-2:], info.get("nothing", "none"), info["x"])
