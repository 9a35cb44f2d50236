"""Storm's results for processes in the language of PRISM.

    python testing/storm.py FILE... [--exact FILE...]

prints a line of JSON for each file: its name, `value`, the greatest probability of reaching the label "goal" from the
initial state, and the number of states. Markov decision processes are solved to 1e-11 by an algorithm with a guaranteed
error bound, or, after --exact, in fractions: `fraction`. Games are solved here by value iteration on Storm's states,
because stormpy has no solver for games.
"""

import json
import sys
from fractions import Fraction

import stormpy
from stormpy import environments

# Fractions may have thousands of digits.
sys.set_int_max_str_digits(0)


def process(program, is_exact):
    """The optimum of a Markov decision process."""
    properties = stormpy.parse_properties('Pmax=? [F "goal"]', program)
    number = stormpy.Rational if is_exact else float
    model = stormpy.build_model[number](program, properties)
    if is_exact:
        environment = environments.exact()
    else:
        environment = environments.sound()
        solver = environment.solver().min_max()
        solver.precision = stormpy.Rational("1/100000000000")
        solver.relative_termination_criterion = False
    result = stormpy.model_checking(
        model, properties[0], only_initial_states=True, environment=environment
    )
    (initial,) = model.initial_states
    return Fraction(str(result.get_value(initial))), model.nr_states


def game(program):
    """The value of a game in which player 0 wants to reach the goal, and the other one does not."""
    properties = stormpy.parse_properties('<<agent>> Pmax=? [F "goal"]', program)
    model = stormpy.build_model[float](program, properties)
    matrix = model.transition_matrix
    won = set(model.labeling.get_states("goal"))
    values = [1.0 if state in won else 0.0 for state in range(model.nr_states)]
    groups = []
    for state in range(model.nr_states):
        rows = range(matrix.get_row_group_start(state), matrix.get_row_group_end(state))
        ways = [[(entry.column, entry.value) for entry in matrix.get_row(row)] for row in rows]
        groups.append((max if model.get_player_of_state(state) == 0 else min, ways))
    # States are numbered as they are found, so those later on mostly have larger numbers.
    backwards = [state for state in reversed(range(model.nr_states)) if state not in won]
    while True:
        greatest = 0.0
        for state in backwards:
            choose, ways = groups[state]
            value = choose(sum(p * values[to] for to, p in way) for way in ways)
            greatest = max(greatest, abs(value - values[state]))
            values[state] = value
        if greatest < 1e-13:
            (initial,) = model.initial_states
            return values[initial], model.nr_states


def main(arguments):
    is_exact = False
    for argument in arguments:
        if argument == "--exact":
            is_exact = True
            continue
        with open(argument, encoding="utf-8") as text:
            is_game = "smg" in (line.strip() for line in text)
        program = stormpy.parse_prism_program(argument)
        value, states = game(program) if is_game else process(program, is_exact)
        answer = {"file": argument, "value": float(value), "states": states}
        if is_exact and not is_game:
            answer["fraction"] = str(value)
        print(json.dumps(answer), flush=True)


main(sys.argv[1:])
