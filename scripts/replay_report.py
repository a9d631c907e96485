#!/usr/bin/python3
"""Makes DIR/report.html, a self-contained page, from the files that replay_score has written to DIR."""
import signal

# Ctrl-C ends this program without a traceback, also while modules are imported. replay_score starts it with SIGINT blocked.
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

import json  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402

try:
    import jinja2
    import matplotlib  # noqa: F401: report_plots needs it
    import numpy
except ImportError as error:
    sys.exit(f'replay_report: {error.name} is missing: install python3-jinja2, python3-matplotlib and python3-numpy.')

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.insert(0, HERE)
from report_page import NONE, embedded, number, percent, png, render_page, table, write_whole  # noqa: E402
import report_plots  # noqa: E402
import surfel_pictures  # noqa: E402

# The paper's own figures, as far as they are known here: one core of an i7-7700, and a GTX 1070; 160 x 120 pixels.
PAPER_FRAME_CPU = '1130–1770'  # [ms]
PAPER_FRAME_GPU = '83.5'  # [ms]
PAPER_STAGES = {'sweeps': ('243', '4.9'), 'median': ('224', '2.0')}  # [ms]
PAPER_BYTES_PER_SURFEL = '38–43'
PAPER_MAP_MB = '90'
PAPER_SURFELS = '2.4'  # [million]


def read_json(path):
    with open(path, encoding='utf-8') as file:
        return json.load(file)


def read_frames(path):
    return numpy.atleast_1d(numpy.genfromtxt(path, delimiter=',', names=True, deletechars=''))


def headlines(summary):
    """(figure, name, meaning) of the main results."""
    surfels, time = summary['surfels'], summary['time_ms']
    rate = f"{number(1000 / time['median'])} frames a second. " if time['median'] else ''
    result = [
        (number(surfels['total']), 'surfels', f"{number(surfels['occupied'])} occupied: on measured surfaces, {number(surfels['frontier'])} "
         'frontier: where space seen to be empty ends and the unknown begins.'),
        (f"{number(time['median'])} ms", 'a frame (median)', f"{rate}The boundary is up to date after each frame.")]
    if 'exact' in summary:
        exact = summary['exact']
        result += [
            (percent(exact['right']), 'right', 'of the surfels: the point a quarter of a radius behind the surfel is unknown, the point 7/4 of a radius before it '
             'is known, judged by the frames themselves.'),
            (percent(exact['miss_2cm']), 'missed', 'of the exact boundary: there is no surfel within 2 cm.')]
    if 'truth' in summary:
        truth = summary['truth']
        result += [(percent(truth['right']), 'right by the truth', 'of the surfels, judged by what an ideal sensor would have seen.'),
                   (percent(truth['miss_2cm']), 'missed by the truth', 'of the boundary that an ideal sensor would have found.')]
    if 'octomap' in summary:
        octomap = summary['octomap']
        ratio, what = speed_ratio(summary)
        result.append((f'{number(ratio)} ×', 'as fast as OctoMap', f"{what}, ratio of the medians. OctoMap: insertPointCloud, voxels of "
                       f"{millimetres(octomap['resolution'])}, the same frames, without the search for its boundary."))
    return result


def speed_ratio(summary):
    """How many times as long OctoMap takes, and what is compared. A mapper in another process has no CPU time here."""
    ours, octomap = summary['time_ms'], summary['octomap']['time_ms']
    what = 'Wall time against wall time'
    if 'cpu_ms' in summary:
        ours, octomap = summary['cpu_ms'], summary['octomap']['cpu_ms']
        what = "CPU time (OctoMap's one thread) against CPU time (all threads of this program)"
    return octomap['median'] / ours['median'] if ours['median'] else None, what


def millimetres(metres):
    return f'{1000 * metres:.3g} mm'


def has_gaps(octomap):
    """Whether neighbouring rays may be further apart than OctoMap's voxels."""
    return octomap['resolution'] < 0.999 * octomap['pixel_spacing']


def accuracy_rows(summary):
    octomap = summary.get('octomap')
    if octomap is None:
        return []
    return [('Surfels of this map, |Ψ|', number(summary['surfels']['total'])),
            ("Surfels of OctoMap's boundary, |M|", number(octomap['surfels'])),
            ('False: of Ψ, no M within 5 cm', number(octomap['fp'])),
            ('Missing: of M, no Ψ within 5 cm', number(octomap['fn'])),
            ('FDR (false discovery rate): false / |Ψ|', percent(octomap['fdr'])),
            ('FOR (false omission rate): missing / |M|', percent(octomap['for']))]


def time_rows(summary):
    """(what, this map, OctoMap, paper CPU, paper GPU) [ms]"""
    time, octomap = summary['time_ms'], summary.get('octomap', {}).get('time_ms', {})
    names = [('mean', 'Mean'), ('median', 'Median'), ('p95', '95 % are below'), ('max', 'Largest')]
    rows = [(text, number(time[key]), number(octomap.get(key)), NONE, NONE) for key, text in names]
    return rows + [('Relative standard deviation', f"{time['rsd_percent']:.1f} %", NONE, NONE, NONE),
                   ("The paper's own figure", NONE, NONE, PAPER_FRAME_CPU, PAPER_FRAME_GPU)]


def stage_rows(summary):
    """(stage, mean, median, share of the mean, paper CPU, paper GPU) [ms]"""
    time = summary['time_ms']
    if not time['stages']:
        return []
    rows = []
    for name, stage in time['stages'].items():
        share = percent(stage['mean'] / time['mean'] if time['mean'] else None)
        rows.append((name.replace('_', ' '), number(stage['mean']), number(stage['median']), share, *PAPER_STAGES.get(name, (NONE, NONE))))
    rest = time['mean'] - sum(stage['mean'] for stage in time['stages'].values())
    return rows + [('outside the stages', number(rest), NONE, percent(rest / time['mean'] if time['mean'] else None), NONE, NONE)]


def memory_rows(summary, bytes_per_surfel):
    surfels, memory = summary['surfels'], summary['memory_mb']
    rows = [('Bytes a surfel', number(bytes_per_surfel), PAPER_BYTES_PER_SURFEL),
            ('Surfels [million]', number(surfels['total'] / 1e6), PAPER_SURFELS),
            ('Map [MB]', number(surfels['map_bytes'] / 1e6), PAPER_MAP_MB),
            ('Device, with the map [MB]', number(memory['device']), NONE),
            ('Process at its largest, with OctoMap and exact test [MB]', number(memory['peak_rss']), NONE)]
    if 'octomap' in summary:
        rows.append((f"OctoMap of {millimetres(summary['octomap']['resolution'])} [MB]", number(summary['octomap']['memory_mb']), NONE))
    return rows


EXACT_SURFELS = [('right', 'Right: unknown behind it, known before it'), ('buried', 'Buried: known on both sides'),
                 ('floating', 'Floating: unknown on both sides'), ('flipped', 'Flipped: known only behind'),
                 ('within_1v', 'Boundary at most 1 voxel away along the normal'),
                 ('within_2v', 'Boundary at most 2 voxels away along the normal'),
                 ('fdr_2cm', 'Boundary further than 2 cm away along the normal'),
                 ('fdr_5cm', 'Boundary further than 5 cm away along the normal')]
EXACT_BOUNDARY = [('miss_1cm', 'No surfel within 1 cm'), ('miss_2cm', 'No surfel within 2 cm'), ('miss_5cm', 'No surfel within 5 cm'),
                  ('label_ok', 'Label is right, of the points with a surfel within 2 cm')]


def exact_tables(summary):
    """Two tables, of the surfels and of the boundary points, with a column for each cloud of surfels and each judge."""
    octomap = summary.get('octomap', {})
    columns = [('by the frames', summary.get('exact')), ('by the truth', summary.get('truth')),
               ('OctoMap by the frames', octomap.get('exact')), ('OctoMap by the truth', octomap.get('truth'))]
    columns = [(name, score) for name, score in columns if score is not None]
    tables = []
    for names, of_what in ((EXACT_SURFELS, 'of the surfels'), (EXACT_BOUNDARY, 'of the boundary points')):
        head = ['', of_what] if 'truth' not in summary else [of_what, *(name for name, _ in columns)]
        tables.append({'head': head, 'rows': [(text, *(percent(score[key]) for _, score in columns)) for key, text in names]})
    return tables if columns else []


def stands_table(objects):
    """A row for each stand of an object and each cosine."""
    rows = []
    for thing in objects:
        for stand in thing['stands']:
            for faces in stand['faces']:
                rows.append((thing['name'], f"{stand['first']} to {stand['last']}", str(stand.get('first_seen', NONE)), f"{faces['cosine']:g}",
                             percent(faces.get('early_covered')), percent(faces.get('covered'))))
    return {'head': ['object', 'stands in frames', 'first seen', 'cosine above', 'on the map 8 frames later', 'at the end'], 'rows': rows}


def left_table(objects):
    rows = []
    for thing in objects:
        if 'left' in thing:
            counts = [count for key in ('left', 'most_left') for count in (thing.get(key, {}).get(label) for label in ('occupied', 'frontier'))]
            rows.append((thing['name'], *(number(count) for count in counts)))
    return {'head': ['object', 'occupied, at the end', 'frontier, at the end', 'occupied, most', 'frontier, most'], 'rows': rows}


def pictures(folder):
    """(caption, image) of the map from outside and from inside, and the same of OctoMap's boundary."""
    trajectory = numpy.loadtxt(os.path.join(folder, 'trajectory.txt'), ndmin=2)
    positions, rotations = trajectory[:, 1:4], surfel_pictures.rotations_of(trajectory[:, 4:8])
    path = surfel_pictures.splats_of_path(positions)
    verdicts = os.path.join(folder, 'verdicts.bin')
    wrong = numpy.fromfile(verdicts, dtype=numpy.uint8) != 0 if os.path.exists(verdicts) else None
    result, outside, inside = [], None, surfel_pictures.inside_camera(positions, rotations)
    for name, title, marked in [('surfels.ply', 'The map', wrong), ('octomap.ply', "OctoMap's boundary", None)]:
        file = os.path.join(folder, name)
        vertices = surfel_pictures.read_ply(file) if os.path.exists(file) else []
        if len(vertices) == 0:
            continue
        splats = surfel_pictures.splats_of(vertices, marked)
        outside = outside or surfel_pictures.outside_camera(rotations, splats.position)
        magenta = '; magenta: errors of the exact test' if marked is not None else ''
        result += [(f'{title} from outside. Surfels that face away are left out; orange: path of the camera{magenta}.',
                    png(surfel_pictures.render(surfel_pictures.joined(splats, path), outside))),
                   (f'{title} from inside, from a little behind the camera in the middle of the recording{magenta}.',
                    png(surfel_pictures.render(splats, inside)))]
    return result


def sweep_plot(folder, summary):
    path = os.path.join(folder, 'sweep.json')
    sweep = read_json(path) if os.path.exists(path) else {}
    if not sweep.get('values'):
        return None
    plot = report_plots.sweep(sweep, summary['config'].get(sweep['parameter']))
    return {'parameter': sweep['parameter'], 'plot': embedded('image/svg+xml', plot)}


def page(folder):
    summary = read_json(os.path.join(folder, 'summary.json'))
    frames = read_frames(os.path.join(folder, 'frames.csv'))
    surfels, octomap = summary['surfels'], summary.get('octomap')
    bytes_per_surfel = surfels['map_bytes'] / surfels['total'] if surfels['total'] else 0
    return render_page(
        'report.html.j2',
        name=os.path.basename(os.path.normpath(summary['input']['path'])), summary=summary, headlines=headlines(summary),
        accuracy=table(['', 'here'], accuracy_rows(summary)),
        times=table(['', 'here', 'OctoMap', 'paper, CPU', 'paper, GPU'], time_rows(summary)),
        stages=table(['', 'mean', 'median', 'share', 'paper, CPU', 'paper, GPU'], stage_rows(summary)),
        memory=table(['', 'here', 'paper'], memory_rows(summary, bytes_per_surfel)), exact=exact_tables(summary), pictures=pictures(folder),
        stands=stands_table(summary.get('objects', [])), left=left_table(summary.get('objects', [])),
        gaps=octomap is not None and has_gaps(octomap), millimetres=millimetres,
        sweep=sweep_plot(folder, summary),
        time_plot=embedded('image/svg+xml', report_plots.time_per_frame(frames, list(summary['time_ms']['stages']))),
        map_plot=embedded('image/svg+xml', report_plots.map_per_frame(frames, bytes_per_surfel)))


def main():
    if len(sys.argv) != 2 or not sys.argv[1] or sys.argv[1].startswith('-'):
        print('usage: replay_report.py DIR\n' + __doc__, file=sys.stderr)
        return 2
    folder = sys.argv[1]
    try:
        write_whole(os.path.join(folder, 'report.html'), page(folder))
    except (OSError, ValueError, KeyError, jinja2.TemplateError) as error:
        print(f"replay_report: the report of '{folder}' could not be made: {type(error).__name__}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
