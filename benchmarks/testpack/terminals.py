"""Terminals of the pack's FMUs, as the elements of terminalsAndIcons.xml."""


def terminal(name: str, rule: str, *members: str, kind: str = "", inner: str = "") -> str:
    """A terminal; a member is "variable", "variable=member" or "variable=member:kind"."""
    parts = ""
    for member in members:
        variable, _, rest = member.partition("=")
        called, _, flow = rest.partition(":")
        own = f' memberName="{called}"' if called else ""
        parts += f'<TerminalMemberVariable variableName="{variable}"{own} variableKind="{flow or "signal"}"/>'
    own = f' terminalKind="{kind}"' if kind else ""
    return f'<Terminal name="{name}" matchingRule="{rule}"{own}>{parts}{inner}</Terminal>'


SOURCE = "\n".join(
    (
        terminal("plug", "plug", "y=value", "count=number", "on=switch", kind="case.a"),
        terminal("bus", "bus", "y=value", "count=number", "mode=mode"),
        terminal("sequence", "sequence", "y", "count"),
        terminal("nested", "plug", "y=value", inner=terminal("whole", "plug", "count=number")),
        terminal("flow", "plug", "y=value:inflow"),
        terminal("own", "case.rule", "y=value"),
    )
)
ECHO = "\n".join(
    (
        terminal("plug", "plug", "boolean_in=switch", "integer_in=number", "real_in=value", kind="case.a"),
        terminal("bus", "bus", "real_in=value", "integer_in=number", "string_in=text"),
        terminal("sequence", "sequence", "real_in", "integer_in"),
        terminal("nested", "plug", "real_in=value", inner=terminal("whole", "plug", "integer_in=number")),
        terminal("inflow", "plug", "real_in=value:inflow"),
        terminal("outflow", "plug", "real_in=value:outflow"),
        terminal("less", "plug", "real_in=value", "integer_in=number"),
        terminal("longer", "sequence", "real_in", "integer_in", "boolean_in"),
        terminal("other", "bus", "string_in=text"),
        terminal("kind", "plug", "boolean_in=switch", "integer_in=number", "real_in=value", kind="case.b"),
        terminal("results", "bus", "real_out=value"),
        terminal("own", "case.rule", "real_in=value"),
    )
)
