"""Predictions by theory, before a scenario is run: modes, settling times, limits of delay, times after an event.

    from gridpeers.lab.predict.inverter_group import inverter_group_of
    from gridpeers.lab.predict.times import LoadStep, predicted_times
    from gridpeers.lab.predict.delay_limits import delay_limit
    from gridpeers.lab.predict.closed_form import delay_limit_closed, modes

    inverters = inverter_group_of(scenario, feeder, "IV")
    predicted_times(inverters, link_delay_s=0.1, loss=0.3)     Times(restore_s, share_s, stable, note)
    delay_limit(inverters, "local loop")                       s, exact for law and plant in discrete time
    delay_limit_closed(inverters, "disagreement")              s, by the continuous equations
    modes(inverters)                                           Modes(lambda_2, lambda_max, ...)

Nothing is imported here, so that `gridpeers --help` does not wait for numpy. docs/theory.md has the equations, and
how far they met the plant.
"""
