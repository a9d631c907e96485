"""The plots of the report, as SVG."""
import io

import matplotlib
import numpy
matplotlib.use('Agg')
from matplotlib import pyplot, ticker  # noqa: E402: the backend must be chosen first

STAGE_COLORS = ['#4e79a7', '#a0cbe8', '#f28e2b', '#ffbe7d', '#59a14f', '#8cd17d', '#b6992d', '#f1ce63', '#499894', '#86bcb6', '#e15759',
                '#ff9d9a', '#79706e', '#bab0ac']
TOTAL = '#222222'
OCTOMAP = '#c0392b'
FRONTIER = '#4080e0'
WARM_UP_FRAMES, FEW_FRAMES = 5, 10

pyplot.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False, 'axes.grid': True, 'grid.color': '#e6e6e6',
                        'axes.axisbelow': True, 'axes.edgecolor': '#888888', 'legend.frameon': False, 'svg.hashsalt': 'frontier_surfels'})


def svg(figure):
    file = io.BytesIO()
    figure.savefig(file, format='svg', metadata={'Date': None})
    pyplot.close(figure)
    return file.getvalue()


def panels(count):
    figure, axes = pyplot.subplots(1, count, figsize=(9.6, 3.4), layout='constrained')
    return figure, axes


def warm(frames):
    """The frames whose times count, as in summary.json: all but the first five, or all if there are no more than ten."""
    return frames[WARM_UP_FRAMES:] if len(frames) > FEW_FRAMES else frames


def top_of_stages(frames):
    """Upper end of an axis on which the frames that count fill the height: the first ones, and single ones for which kernels are compiled,
    take many times as long. 'Whole frame' shows them."""
    times = warm(frames)['total']
    return 1.05 * max(min(times.max(), 3 * numpy.percentile(times, 95)), 1e-3)


def title_of_stages(frames):
    beyond = int((frames['total'] > top_of_stages(frames)).sum())
    return 'Stages' if beyond == 0 else f'Stages ({beyond} of the frames took longer)'


def time_per_frame(frames, stages):
    """Times per frame. `frames`: table of frames.csv; `stages`: names of its columns with the times of stages, in their order."""
    figure, (stacked, beside) = panels(2)
    index = range(len(frames))
    if stages:
        timed = numpy.flatnonzero(sum(frames[name] for name in stages))  # other frames have no times of stages
        stacked.stackplot(timed, [frames[name][timed] for name in stages], labels=stages, colors=STAGE_COLORS, linewidth=0)
    stacked.plot(index, frames['total'], color=TOTAL, linewidth=0.8, label='total (wall)')
    stacked.set(xlabel='frame', ylabel='time [ms]', title=title_of_stages(frames), xlim=(0, max(len(frames) - 1, 1)),
                ylim=(0, top_of_stages(frames)))
    handles, labels = stacked.get_legend_handles_labels()
    stacked.legend(handles[::-1], labels[::-1], fontsize=7, loc='center left', bbox_to_anchor=(1, 0.5), handlelength=1)

    beside.plot(index, frames['total'], color=TOTAL, linewidth=1, label='this map, with its boundary')
    if 'octomap_ms' in frames.dtype.names:
        beside.plot(index, frames['octomap_ms'], color=OCTOMAP, linewidth=1, label='OctoMap, without its boundary')
    beside.set(xlabel='frame', ylabel='time [ms]', title='Whole frame', yscale='log', xlim=(0, max(len(frames) - 1, 1)))
    beside.yaxis.set_major_formatter(ticker.LogFormatter())
    beside.yaxis.set_minor_formatter(ticker.LogFormatter(minor_thresholds=(2, 0.7)))  # on short axes, numbers between powers of ten are shown
    beside.legend(fontsize=8, loc='best')
    return svg(figure)


def map_per_frame(frames, bytes_per_surfel):
    figure, (size, change) = panels(2)
    index = range(len(frames))
    size.plot(index, frames['surfels'] / 1e6, color=TOTAL, linewidth=1.2)
    size.set(xlabel='frame', ylabel='surfels [million]', title='Map', xlim=(0, max(len(frames) - 1, 1)), ylim=(0, None))
    if bytes_per_surfel > 0:
        memory = size.secondary_yaxis('right', functions=(lambda n: n * bytes_per_surfel, lambda mb: mb / bytes_per_surfel))
        memory.set_ylabel(f'memory [MB] at {bytes_per_surfel:.1f} bytes a surfel')

    change.plot(index, frames['created'] / 1e3, color=FRONTIER, linewidth=0.9, label='created')
    change.plot(index, frames['removed'] / 1e3, color=OCTOMAP, linewidth=0.9, label='removed')
    change.set(xlabel='frame', ylabel='surfels a frame [thousand]', title='Change', xlim=(0, max(len(frames) - 1, 1)), ylim=(0, None))
    change.legend(fontsize=8)
    return svg(figure)


def sweep(data, configured):
    """The paper's figure 19: shares over the varied parameter. `configured`: the value of the main run, or None."""
    figure, (errors, right) = panels(2)
    values = [point['value'] for point in data['values']]
    curves = [(errors, 'octomap', 'fdr', 'FDR (OctoMap, 5 cm)', OCTOMAP, 's'),
              (errors, 'octomap', 'for', 'FOR (OctoMap, 5 cm)', '#f28e2b', '^'),
              (errors, 'exact', 'miss_2cm', 'boundary missed by 2 cm', FRONTIER, 'o'),
              (right, 'exact', 'right', 'right', '#2e8b57', 'o')]
    for axes, score, key, label, color, marker in curves:
        if all(score in point for point in data['values']):
            shares = [100 * point[score][key] for point in data['values']]
            axes.plot(values, shares, color=color, marker=marker, markersize=4, linewidth=1.2, label=label)
    unit = f" [{data['unit']}]" if data.get('unit') else ''
    for axes in (errors, right):
        axes.set(xlabel=data['parameter'] + unit, ylabel='share [%]')
        if configured is not None:
            axes.axvline(configured, color='#999999', linestyle='--', linewidth=1, label='as configured')
        axes.legend(fontsize=8)
    errors.set(title='Errors: less is better', ylim=(0, None))
    right.set(title='Right surfels: more is better')
    return svg(figure)
