"""What robot code may import, and the built-in names it may use; a test compares this with the interpreter."""

from __future__ import annotations

# ruff: noqa: SIM905 (split strings: a list literal of sixty names a line each hides what is there)
from memo_core.sandbox import prelude

MODULES: dict[str, tuple[str, ...]] = {
    "math": tuple(
        "acos acosh asin asinh atan atan2 atanh cbrt ceil comb copysign cos cosh degrees dist e erf erfc exp exp2 "
        "expm1 fabs factorial floor fmod frexp fsum gamma gcd hypot inf isclose isfinite isinf isnan isqrt lcm ldexp "
        "lgamma log log10 log1p log2 modf nan nextafter perm pi pow prod radians remainder sin sinh sqrt tan tanh tau "
        "trunc ulp".split()
    ),
    "time": ("sleep", "time", "monotonic", "perf_counter"),
    "random": tuple("Random choice choices gauss randint random randrange sample seed shuffle uniform".split()),
    "itertools": tuple(
        "accumulate chain combinations combinations_with_replacement compress count cycle dropwhile filterfalse "
        "groupby islice pairwise permutations product repeat starmap takewhile tee zip_longest".split()
    ),
    "functools": ("cache", "lru_cache", "partial", "reduce"),
    "collections": ("Counter", "defaultdict", "deque", "namedtuple"),
    "dataclasses": ("dataclass", "field"),
    "typing": tuple(
        "Annotated Any Callable ClassVar Dict Final FrozenSet Iterable Iterator List Literal Mapping Optional Sequence "
        "Set Tuple Type TypeVar Union".split()
    ),
    "copy": ("copy", "deepcopy"),
    "json": ("dumps", "loads"),
    "re": tuple("compile escape findall finditer fullmatch match search split sub".split()),
    "bisect": tuple("bisect bisect_left bisect_right insort insort_left insort_right".split()),
    "__future__": ("annotations",),
    **prelude.array_names(),
}

BUILTINS = frozenset(
    "ArithmeticError AssertionError AttributeError BaseException Ellipsis Exception ImportError IndexError "
    "KeyError KeyboardInterrupt LookupError MemoryError NameError NotImplemented NotImplementedError OSError "
    "OverflowError RecursionError RuntimeError StopIteration TimeoutError TypeError UnboundLocalError ValueError "
    "ZeroDivisionError __name__ __doc__ abs all any bin bool bytes callable chr complex dict divmod enumerate "
    "filter float format frozenset getattr hasattr hash hex id int isinstance iter len list map max min next "
    "object oct ord pow print range repr reversed round set setattr slice sorted str sum tuple type zip "
    "MotionError SkillError InvalidArgument UnknownName".split()
)

REFUSED: dict[str, str] = {
    "open": "robot code has no files",
    "input": "robot code cannot ask a person",
    "eval": "write the expression itself",
    "exec": "write the statements themselves",
    "compile": "write the statements themselves",
    "__import__": "use an import statement",
    "globals": "use your own variables or a dict",
    "locals": "use your own variables or a dict",
    "vars": "use your own variables or a dict",
    "dir": "the skills are listed in the prompt",
    "help": "the skills are listed in the prompt",
    "exit": "return from a function or raise an exception",
    "quit": "return from a function or raise an exception",
    "SystemExit": "raise RuntimeError instead",
    "breakpoint": "use print",
    "super": "classes cannot inherit here",
    "property": "write a method without a decorator",
    "staticmethod": "write a function outside the class",
    "classmethod": "write a function outside the class",
    "delattr": "set the attribute to None",
    "issubclass": "use isinstance",
    "bytearray": "use a list",
    "memoryview": "use a list",
}
