"""From recordings to materials [Ren, Yeh, Lin 2013, sections 4 and 5].

    recording -> Features (features.py) \\
    case or strike -> Observation
        -> distance (metric.py) -> optimise -> MaterialFit (material_fit.py) -> preset -> the run time
    mesh + guess -> ModalModel (modal)  /

The run time never imports this room: a preset is the only bridge. Values between its parts stand in values.py.
"""
