r"""From recordings to materials [after Ren, Yeh, Lin 2013, sections 4 and 5; their own search: studies/ren2013].

    recordings -> Lines (lines) \
    mesh + guess -> Family (modal) -> pairs, least squares (fit) -> MaterialFit -> preset -> the run time
    case -> Observation        /

The run time never imports this package: a preset is the only bridge. Values between its parts stand in
lines/line_values.py.
"""
