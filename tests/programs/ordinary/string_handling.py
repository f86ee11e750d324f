for sentence in get_relations():
    subject = sentence.replace("the ", "").split(" is ")[0].strip().title()
    print(subject, sentence.count("table"), sentence.startswith("the"), "cube" in sentence.lower())
name = "  Red_Cube ".strip().lower().replace("_", " ")
print(name, get_position(name)[0], name[::-1], name.find("cube"), "-" * 10)
