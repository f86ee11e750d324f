d={'k':1.5,"it's":2}
g=sum(x for x in [1])
print(f"a\n{d['k']:.2f}\t{g!r:>5} {'yes' if g else 'no'}")
print(f'{d["k"]} "quoted" \'single\' {{braces}} \\ backslash')
print(f"""multi
line {d["it's"]} {', '.join(str(x) for x in [1,2])} "q" 'q' """)
print(f"{any(v > 1 for v in d.values())} {d.get} "[:5], f"{max(d, key=d.get)}")
print("%s\n" % 'x', 'a\\b', r'\d', "tab\t|", 'é✓', "\u00e9", '\x41')
w=7
print(f"{3.14159:{w}.{2}f}|{'x':^{w}}|{w=}")
