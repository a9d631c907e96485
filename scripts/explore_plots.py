"""The plots of an exploration's page, as SVG."""
from matplotlib import pyplot

import explore_figures
from explore_pictures import FLAT
from report_plots import panels, svg

COLORS = {'frontiers': '#2f6fd0', 'octomap': '#c0392b', 'nearest': '#2e8b57', 'random': '#79706e'}
GOAL_LINE = '#999999'


def coverage(strategies):
    """Share seen against views, metres and seconds. A dot marks where a strategy has reached 95 %. strategies: as explore_figures.read() gives them"""
    figure, axes = panels(3)
    for axis, column, label in zip(axes, ('views', 'metres', 'seconds'), ('views', 'way of the camera [m]', 'time [s]')):
        axis.axhline(100 * explore_figures.GOAL, color=GOAL_LINE, linestyle='--', linewidth=1)
        for name, rows in strategies.items():
            axis.plot(rows[column], 100 * rows['share'], color=COLORS[name], linewidth=1.3, label=explore_figures.STRATEGIES[name].label,
                      marker='.' if len(rows) == 1 else None)  # a line through one point cannot be seen
            goal = explore_figures.goal_row(rows)
            if goal is not None:
                axis.plot(goal[column], 100 * goal['share'], 'o', color=COLORS[name], markersize=5)
        axis.set(xlabel=label, ylim=(0, 102), xlim=(0, max(1e-3, 1.02 * max(rows[column][-1] for rows in strategies.values()))))
    axes[0].set_ylabel('share seen [%]')
    axes[0].annotate('95 %', (0, 100 * explore_figures.GOAL), xytext=(3, -10), textcoords='offset points', fontsize=8, color=GOAL_LINE)
    axes[0].legend(fontsize=8, loc='lower right')
    return svg(figure)


def paths(strategies, plan):
    """The way of each strategy in the flat from above, x to the right; a ring where it begins, a dot where it ends.
    plan: of explore_pictures.floor_plan(), or None"""
    figure, axes = pyplot.subplots(figsize=(9.6, 7.2), layout='constrained')
    if plan is not None:
        axes.imshow(1 - 0.55 * plan, origin='lower', extent=(0, FLAT[0], 0, FLAT[1]), cmap='gray', vmin=0, vmax=1, interpolation='bilinear')
    axes.add_patch(pyplot.Rectangle((0, 0), FLAT[0], FLAT[1], fill=False, edgecolor='#555555'))
    for name, rows in reversed(list(strategies.items())):  # the first one on top
        axes.plot(rows['x'], rows['y'], color=COLORS[name], linewidth=1.8 if name == 'frontiers' else 1.1, label=explore_figures.STRATEGIES[name].label)
        axes.plot(rows['x'][0], rows['y'][0], 'o', color=COLORS[name], markerfacecolor='white', markersize=7)
        axes.plot(rows['x'][-1], rows['y'][-1], 'o', color=COLORS[name], markersize=6)
    axes.set(xlabel='x [m]', ylabel='y [m]', aspect='equal', xlim=(-0.1, FLAT[0] + 0.1), ylim=(-0.1, FLAT[1] + 0.1))
    axes.grid(False)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], fontsize=9, loc='lower center', bbox_to_anchor=(0.5, 1), ncol=len(strategies))
    return svg(figure)
