"""Values that are valid in JSON and TOML, and that no reader expects."""

NASTY = (
    "9" * 4301, "9" * 4000, "-" + "9" * 4000, "1e400", "1e308", "-1", "0", "0.5", "18446744073709551616",
    "true", '""', '"x"', '"\\u0000"', '"' + "x" * 3000 + '"', "[]", "[1, 2]", "[[[[[[[[1]]]]]]]]",
)  # fmt: skip
