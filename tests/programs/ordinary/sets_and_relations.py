relations = set(get_relations())
on_table = {r for r in relations if "on the" in r}
expected = {"the red cube is on the table"}
print(expected <= relations, len(on_table & expected), "the oven is open" in relations)
words = {w for r in relations for w in r.split()}
print(sorted(words))
