"""Check the scene before doing anything."""


def check_scene():
    """Everything that is needed is there."""
    names = get_objects()
    assert "red cube" in names, "no red cube"
    assert len(names) >= 2
    return names


names = check_scene()
try:
    assert "banana" in names, "no banana here"
except AssertionError as error:
    print("assertion:", error)
print(len(names))
