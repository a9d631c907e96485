"""What happened in an exploration: reads exploration.csv, and says what each strategy needed."""
import collections
import math
import os
import re

import numpy

FILE = 'exploration.csv'
COLUMNS = ('strategy', 'views', 'metres', 'seconds', 'share', 'decision_ms', 'x', 'y', 'z')
GOAL = 0.95  # the share at which strategies are compared

# label: of its lines; name: in a sentence; about: how it chooses where to go
Strategy = collections.namedtuple('Strategy', 'label name about')
STRATEGIES = {
    'frontiers': Strategy('frontier clusters', 'the planner on frontier clusters',
                          "The package's own planner. The map joins its frontier surfels to clusters, proposes views of each, and says what each of "
                          'these would show. The planner goes to the view that shows much frontier for a short way.'),
    'octomap': Strategy("OctoMap's frontier", "the same planner on OctoMap's frontier",
                        "The same planner. Its clusters are made of the frontier voxels of an OctoMap of 5 cm: free voxels beside unknown ones."),
    'nearest': Strategy('nearest frontier', 'the planner that goes to the nearest frontier',
                        'Goes to the nearest frontier, however little is to be seen there.'),
    'random': Strategy('random views', 'random free views', 'Goes to random positions in free space and looks in random directions.'),
}


def read(folder):
    """The rows of each strategy, in the order of the file: {name: structured array with the other columns}.
    @throws ValueError  one sentence, if the file is not as it should be"""
    path = os.path.join(folder, FILE)
    try:
        with open(path, encoding='utf-8') as file:
            lines = file.read().splitlines()
    except UnicodeDecodeError as error:
        raise ValueError(f"'{path}' is no text.") from error
    if not lines:
        raise ValueError(f"'{path}' is empty.")
    if lines[0] != ','.join(COLUMNS):
        raise ValueError(f"the first line of '{path}' is not {','.join(COLUMNS)}.")
    rows, last = {}, None
    for number, line in enumerate(lines[1:], start=2):
        name, values = row(line, f"line {number} of '{path}'")
        if name != last and name in rows:
            raise ValueError(f"line {number} of '{path}' goes on with {name} after another strategy.")
        rows.setdefault(name, []).append(values)
        last = name
        if len(rows[name]) > 1 and not grows(*rows[name][-2:]):
            raise ValueError(f"line {number} of '{path}' has fewer views, metres or seconds than the line before it.")
    if not rows:
        raise ValueError(f"'{path}' has no rows: not one image was taken.")
    return {name: numpy.array(values, dtype=[(column, float) for column in COLUMNS[1:]]) for name, values in rows.items()}


def row(line, where):
    """(strategy, its numbers) of a line. @throws ValueError"""
    name, *words = line.split(',')
    if len(words) != len(COLUMNS) - 1:
        raise ValueError(f'{where} has {len(words) + 1} values instead of {len(COLUMNS)}.')
    if name not in STRATEGIES:
        raise ValueError(f"{where} has the strategy '{name[:40]}', which is none of {', '.join(STRATEGIES)}.")
    values = []
    for column, word in zip(COLUMNS[1:], words):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or (column not in 'xyz' and value < 0) or (column == 'share' and value > 1) or (
                column == 'views' and (value < 1 or value != int(value))):
            raise ValueError(f"{where} has '{word[:40]}' for {column}.")
        values.append(value)
    return name, tuple(values)


def grows(before, after):
    """Whether there are more views, and no fewer metres and seconds."""
    return after[0] > before[0] and after[1] >= before[1] and after[2] >= before[2]


def positions(rows):
    """Of the camera [m], world frame."""
    return numpy.stack([rows[axis] for axis in 'xyz'], axis=1)


def goal_row(rows):
    """The first row in which 95 % are seen, or None."""
    reached = numpy.flatnonzero(rows['share'] >= GOAL)
    return rows[reached[0]] if len(reached) else None


def figures(rows):
    """What a strategy needed, as in explore.json."""
    goal, end = goal_row(rows), rows[-1]
    result = {f'{column}_95': None if goal is None else float(goal[column]) for column in ('views', 'metres', 'seconds')}
    result.update({column: float(end[column]) for column in ('views', 'metres', 'seconds', 'share')})
    for key in ('views', 'views_95'):
        result[key] = None if result[key] is None else int(result[key])
    decisions = rows['decision_ms'][rows['decision_ms'] > 0]  # the first look around is no decision
    median, p95 = numpy.percentile(decisions, [50, 95]) if len(decisions) else (None, None)
    result['decision_ms_median'], result['decision_ms_p95'] = (None if time is None else float(time) for time in (median, p95))
    return result


def ratios(ours, other):
    """{'views', 'metres', 'seconds': (ratio of ours to the other's for 95 %, whether it is only an upper bound)}: if the other has not
    reached 95 %, it needs more than all it took. None where nothing can be said."""
    result = {}
    for column in ('views', 'metres', 'seconds'):
        mine, theirs = ours[f'{column}_95'], other[f'{column}_95']
        bound = theirs is None
        theirs = other[column] if bound else theirs
        # another one that was stopped before we were done says nothing
        unknown = mine is None or theirs <= 0 or (bound and mine >= theirs)
        result[column] = None if unknown else (mine / theirs, bound)
    return result


def films(folder, strategies):
    """The maps that lie in the folder, [(views, path)] for each strategy, by views. Those that no row belongs to are of another exploration."""
    result = {name: [] for name in strategies}
    for file in os.listdir(folder):
        match = re.fullmatch(r'([a-z]+)_(\d+)\.ply', file)
        if match and match[1] in strategies and int(match[2]) in strategies[match[1]]['views']:
            result[match[1]].append((int(match[2]), os.path.join(folder, file)))
    return {name: sorted(film) for name, film in result.items() if film}
