from dataclasses import dataclass, field
@dataclass
class P:
    x: float=0
    tags: list=field(default_factory=list)
    def m(self): return self.x*2
a=P(1); b=P(1); a.tags.append(1); print(a,b,a==b,a.m(),P(x=3).x)
