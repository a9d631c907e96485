#!/usr/bin/python3
"""Makes FOLDER/explore.html, a self-contained page about an exploration of the synthetic flat, from what `explore` has written to FOLDER:
exploration.csv and maps STRATEGY_VIEWS.ply. The figures alone go to explore.json. Of the maps, which are large, only the last one of each
strategy stays: the others are deleted once their pictures are in the page.
"""
import signal

# Ctrl-C ends this program without a traceback, also while modules are imported. explore may start it with SIGINT blocked.
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

import json  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402

try:
    import jinja2
    import matplotlib  # noqa: F401: explore_plots needs it
    import numpy  # noqa: F401: explore_figures needs it
except ImportError as error:
    sys.exit(f'explore_report: {error.name} is missing: install python3-jinja2, python3-matplotlib and python3-numpy.')

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from report_page import NONE, embedded, number, percent, png, render_page, table, write_whole  # noqa: E402
import explore_figures  # noqa: E402
from explore_figures import STRATEGIES  # noqa: E402
import explore_pictures  # noqa: E402
import explore_plots  # noqa: E402
import surfel_pictures  # noqa: E402

OURS = 'frontiers'
COMPARED = ('views', 'metres', 'seconds')


def times(ratio):
    """A ratio of explore_figures.ratios() as text."""
    return NONE if ratio is None else f"{'< ' if ratio[1] else ''}{number(ratio[0])} ×"


def headlines(figures):
    """(figure, name, meaning, colour) of each strategy."""
    result = []
    for name, one in figures.items():
        if one['views_95'] is None:
            figure = 'not reached'
            meaning = f"95 % not reached in {number(one['views'])} views, {number(one['metres'])} m and {number(one['seconds'])} s."
        else:
            figure = f"{number(one['views_95'])} views"
            meaning = f"for 95 %, with {number(one['metres_95'])} m and {number(one['seconds_95'])} s."
        meaning += f" At the end {percent(one['share'])} seen."
        if one['decision_ms_median'] is not None:
            meaning += f" A decision takes {number(one['decision_ms_median'])} ms (median; 95 % are below {number(one['decision_ms_p95'])} ms)."
        result.append((figure, STRATEGIES[name].label, meaning, explore_plots.COLORS[name]))
    return result


def comparisons(figures):
    """(strategy, ratios of ours to its) of the others, as far as anything can be said."""
    if OURS not in figures:
        return []
    found = [(name, explore_figures.ratios(figures[OURS], other)) for name, other in figures.items() if name != OURS]
    return [(name, ratios) for name, ratios in found if any(ratios.values())]


def ratio_headlines(compared):
    """(figure, name, meaning, colour) of each strategy that ours is compared with."""
    result = []
    for name, ratios in compared:
        figure = 'views' if ratios['views'] else next(column for column in COMPARED if ratios[column])
        rest = ' and '.join(f'{times(ratios[column])} the {column}' for column in COMPARED if column != figure and ratios[column])
        meaning = f"of {STRATEGIES[name].name}, to reach 95 %{'; ' + rest if rest else ''}."
        if ratios[figure][1]:
            meaning += ' 95 % was not reached there, so that it is less than this.'
        result.append((times(ratios[figure]), f'the {figure}', meaning, explore_plots.COLORS[name]))
    return result


def main_table(figures):
    head = ['', '95 %: views', 'way [m]', 'time [s]', 'end: views', 'way [m]', 'time [s]', 'seen', 'decision: median [ms]', '95 % below [ms]']
    rows = []
    for name, one in figures.items():
        views = 'not reached' if one['views_95'] is None else number(one['views_95'])
        rows.append((STRATEGIES[name].label, views, number(one['metres_95']), number(one['seconds_95']), number(one['views']),
                     number(one['metres']), number(one['seconds']), percent(one['share']), number(one['decision_ms_median']),
                     number(one['decision_ms_p95'])))
    return table(head, rows)


def ratio_table(compared):
    rows = [(STRATEGIES[name].label, *(times(ratios[column]) for column in COMPARED)) for name, ratios in compared]
    return table(['to reach 95 %', 'views', 'way', 'time'], rows)


def film_strips(films, strategies):
    """([{label, pictures: [(title, image)]}] with a film for each strategy, floor plan of the last map or None)"""
    camera, strips, plan = explore_pictures.flat_camera(), [], None
    for name, film in films.items():
        rows, images = strategies[name], []
        for views, path in film:
            so_far = rows[rows['views'] <= views]
            title = f"{views} view{'s' if views > 1 else ''}, {so_far['metres'][-1]:.1f} m, {100 * so_far['share'][-1]:.1f} %"
            try:
                surfels = surfel_pictures.read_ply(path)
                images.append((title, png(explore_pictures.map_picture(surfels, explore_figures.positions(so_far), camera))))
                last = path == film[-1][1] and plan is None  # of our planner, if it has any
                plan = explore_pictures.floor_plan(surfels) if last else plan
            except (KeyError, IndexError, ValueError) as error:
                raise ValueError(f"'{path}' is no map of surfels: {error}") from error
        strips.append({'label': STRATEGIES[name].label, 'pictures': images})
    return strips, plan


def page(folder, strategies, figures, films):
    strips, plan = film_strips(films, strategies)
    compared = comparisons(figures)
    return render_page(
        'explore.html.j2', name=os.path.basename(os.path.abspath(folder)), headlines=headlines(figures), ratios=ratio_headlines(compared),
        figures=main_table(figures), comparison=ratio_table(compared),
        bounds=any(ratio and ratio[1] for _, ratios in compared for ratio in ratios.values()), strips=strips, with_map=plan is not None,
        explanations=[STRATEGIES[name] for name in strategies],
        coverage_plot=embedded('image/svg+xml', explore_plots.coverage(strategies)),
        paths_plot=embedded('image/svg+xml', explore_plots.paths(strategies, plan)))


def make(folder):
    """Writes explore.json and explore.html, and deletes the maps that are no longer needed."""
    found = explore_figures.read(folder)
    strategies = {name: found[name] for name in STRATEGIES if name in found}  # in our order
    figures = {name: explore_figures.figures(rows) for name, rows in strategies.items()}
    films = explore_figures.films(folder, strategies)
    html = page(folder, strategies, figures, films)
    write_whole(os.path.join(folder, 'explore.json'), json.dumps(figures, indent=2) + '\n')
    write_whole(os.path.join(folder, 'explore.html'), html)
    for film in films.values():
        for _, path in film[:-1]:
            os.remove(path)


def main():
    if len(sys.argv) != 2 or not sys.argv[1] or sys.argv[1].startswith('-'):
        print('usage: explore_report.py FOLDER\n' + __doc__, end='', file=sys.stderr)
        return 2
    try:
        make(sys.argv[1])
    except (OSError, ValueError, jinja2.TemplateError) as error:
        kind = '' if type(error) is ValueError else f'{type(error).__name__}: '  # those are sentences of this package
        print(f"explore_report: the page of '{sys.argv[1]}' could not be made: {kind}{error}", file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
