#!/usr/bin/python3
"""Tests the command replay_score: usage, errors, and all files that it writes about a small synthetic room.

usage: test_replay_score.py REPLAY_SCORE MAKE_SYNTHETIC
"""
import base64
import csv
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import matplotlib.image
import numpy
from PIL import Image as Picture

PROGRAM, MAKE_SYNTHETIC = None, None
FRAMES = 16
DONE, FAILED, WRONG_USAGE = 0, 1, 2
SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..')
SURFEL = numpy.dtype([(name, '<f4') for name in ('x', 'y', 'z', 'nx', 'ny', 'nz', 'radius')] +
                     [(name, 'u1') for name in ('red', 'green', 'blue', 'label')])


def run(*arguments, **options):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=500, **options)


def read_json(folder, name='summary.json'):
    with open(os.path.join(folder, name), encoding='utf-8') as file:
        return json.load(file)


def read_rows(folder):
    with open(os.path.join(folder, 'frames.csv'), encoding='utf-8') as file:
        return list(csv.DictReader(file))


def read_surfels(folder, name='surfels.ply'):
    """Reads the header itself, so that a fault of the program's own reader or writer is found."""
    with open(os.path.join(folder, name), 'rb') as file:
        content = file.read()
    header, body = content.split(b'end_header\n', 1)
    properties = re.findall(rb'property (\w+) (\w+)', header)
    assert properties == [(b'float' if SURFEL[name] == '<f4' else b'uchar', name.encode()) for name in SURFEL.names], properties
    count = int(re.search(rb'element vertex (\d+)', header).group(1))
    assert len(body) == count * SURFEL.itemsize, f'{len(body)} bytes for {count} surfels'
    return numpy.frombuffer(body, dtype=SURFEL)


class Usage(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.report = os.path.join(self.folder.name, 'report')

    def check_refused(self, code, *sentences, arguments):
        result = run(*arguments)
        self.assertEqual(result.returncode, code, result.stderr)
        for sentence in sentences:
            self.assertRegex(result.stderr, sentence)
        self.assertEqual('Usage: ' in result.stderr, code == WRONG_USAGE, result.stderr)
        self.assertEqual(result.stdout, '')
        self.assertFalse(os.path.exists(os.path.join(self.report, 'report.html')))

    def test_wrong_usage_prints_the_usage(self):
        there = [self.folder.name, '--report', self.report]
        wrong = ['another', '--no-such-option', '--first -1', '--first 5 --last 4', '--stride 0', '--threads many',
                 '--octomap-resolution -1', '--octomap-resolution nan', '--octomap-resolution automatic', '--sweep th_d=1', '--sweep no_such=0:1:3', '--set th_d']
        for arguments in [[], [self.folder.name], ['--report', self.report], *([*there, *text.split()] for text in wrong)]:
            with self.subTest(arguments=arguments):
                self.check_refused(WRONG_USAGE, 'replay_score: .', arguments=arguments)

    def test_all_faults_of_the_settings_are_reported_at_once(self):
        self.check_refused(WRONG_USAGE, 'no_such', 'z_max', 'decimation', arguments=[
            self.folder.name, '--report', self.report, '--set', 'no_such=1', '--set', 'z_max=far', '--set', 'decimation=0'])

    def test_a_setting_does_not_swallow_the_input(self):
        self.check_refused(FAILED, 'no-such-recording', arguments=['--report', self.report, '--set', 'th_d=0.3', 'no-such-recording'])

    def test_failures_are_reported_in_one_sentence(self):
        for sentence, arguments in [('no-such-recording', ['no-such-recording', '--report', self.report]),
                                    ('report.*--report', [self.folder.name, '--report', '/proc/no-such-folder']),
                                    ('a folder, but --live plays bags: make a bag of it with sequence_to_bag|--live needs ROS', [self.folder.name, '--report', self.report, '--live']),
                                    ('no-such.yaml', [self.folder.name, '--report', self.report, '--config', 'no-such.yaml'])]:
            with self.subTest(arguments=arguments):
                self.check_refused(FAILED, sentence, arguments=arguments)

    def test_names_that_are_too_long(self):
        name = 300 * 'n'
        for arguments in ([name, '--report', self.folder.name], [self.folder.name, '--report', self.folder.name, '--config', name]):
            self.check_refused(1, name, arguments=arguments)
        result = subprocess.run([MAKE_SYNTHETIC, name], capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, '^[^\\n]*' + name + r'[^\n]*choose another folder\.\n$')

    def test_a_tilde_that_no_shell_has_expanded_is_the_home_folder(self):
        environment = {**os.environ, 'HOME': self.folder.name}
        made = subprocess.run([MAKE_SYNTHETIC, "~/it's a room", '--frames', '2', '--size', '160x120'], capture_output=True, text=True,
                              timeout=60, env=environment)
        room = os.path.join(self.folder.name, "it's a room")
        self.assertEqual((made.stdout, made.stderr), (f'2 frames are in {room}.\n', ''))
        with open(os.path.join(self.folder.name, 'config.yaml'), 'w', encoding='utf-8') as file:
            file.write('recent_views: 3\n')
        result = run("~/it's a room", '--report=~/report', '--config=~/config.yaml', '--octomap-resolution', 0, '--no-exact', env=environment)
        self.assertEqual(result.returncode, 0, result.stderr)
        summary = read_json(os.path.join(self.folder.name, 'report'))
        self.assertEqual((summary['input']['path'], summary['config']['recent_views']), (room, 3))
        self.assertIn(os.path.join(self.folder.name, 'report', 'report.html'), result.stdout)

    def test_help_and_parameters_need_nothing_else(self):
        usage = run('--help')
        self.assertEqual((usage.returncode, usage.stderr), (DONE, ''))
        for option in ('--report --config --set --first --last --stride --depth-topic --info-topic --color-topic --world-frame '
                       '--octomap-resolution --truth --no-exact --threads --sweep --live --mapper --parameters --devices').split():
            self.assertIn(option, usage.stdout)
        devices = run('--devices')
        self.assertEqual((devices.returncode, devices.stderr), (DONE, ''))
        self.assertRegex(devices.stdout, r'The default configuration takes \S.* \(.*\)\.\n$|pocl-opencl-icd')
        table = run('--parameters')
        self.assertEqual((table.returncode, table.stderr), (DONE, ''))
        self.assertIn('| `recent_view_angle` |', table.stdout)
        with open(os.path.join(SOURCES, 'doc', 'parameters.md'), encoding='utf-8') as file:
            document = file.read()
        # The node's own parameters come last; a program without ROS does not know them.
        whole = document if '## ROS node' in table.stdout else document[:document.index('\n## ROS node')]
        self.assertEqual(table.stdout, whole, 'renew it with: replay_score --parameters > doc/parameters.md')


class SyntheticRoom(unittest.TestCase):
    """Many tests look at the results of one run that has everything switched on, with the paper's known space, on which th_d acts."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.room = os.path.join(cls.folder.name, 'room')
        subprocess.run([MAKE_SYNTHETIC, cls.room, '--frames', str(FRAMES)], check=True, stdout=subprocess.DEVNULL)
        cls.report = os.path.join(cls.folder.name, 'a new', 'report')
        cls.result = run(cls.room, '--report', cls.report, '--set', 'decimation=8', '--set', 'recent_views=2', '--set', 'seen_points=false',
                         '--octomap-resolution', 0.04, '--threads', 2,
                         '--sweep', 'th_d=0.2:0.4:2', cwd='/')

    def setUp(self):
        self.assertEqual(self.result.returncode, DONE, self.result.stderr)

    def test_summary_agrees_with_the_map(self):
        summary, surfels = read_json(self.report), read_surfels(self.report)
        self.assertEqual(summary['input'], {'path': self.room, 'frames': FRAMES, 'skipped': 0})
        self.assertGreater(len(surfels), 10000)
        self.assertEqual(summary['surfels']['total'], len(surfels))
        self.assertEqual(summary['surfels']['occupied'], int((surfels['label'] == 1).sum()))
        self.assertEqual(summary['surfels']['frontier'], int((surfels['label'] == 0).sum()))
        self.assertGreater(min(summary['surfels']['occupied'], summary['surfels']['frontier']), 0)
        self.assertGreaterEqual(summary['surfels']['map_bytes'], 16 * len(surfels))
        self.assertEqual(summary['octomap']['surfels'], len(read_surfels(self.report, 'octomap.ply')))
        self.assertEqual((summary['config']['decimation'], summary['config']['threads']), (8, 2))

    def test_shares_are_shares(self):
        summary = read_json(self.report)
        exact, octomap = summary['exact'], summary['octomap']
        for name, share in {**exact, 'fdr': octomap['fdr'], 'for': octomap['for']}.items():
            self.assertTrue(0 <= share <= 1, (name, share))
        self.assertAlmostEqual(exact['right'] + exact['buried'] + exact['floating'] + exact['flipped'], 1, places=9)
        self.assertAlmostEqual(octomap['fdr'], octomap['fp'] / summary['surfels']['total'], places=12)
        self.assertAlmostEqual(octomap['for'], octomap['fn'] / octomap['surfels'], places=12)
        self.assertGreater(exact['right'], 0.5)
        self.assertLess(exact['miss_5cm'], 0.1)

    def test_frames_agree_with_the_summary(self):
        summary, rows = read_json(self.report), read_rows(self.report)
        self.assertEqual(len(rows), FRAMES)
        stages = list(summary['time_ms']['stages'])
        self.assertEqual(list(rows[0]), ['stamp', 'surfels', 'created', 'removed', *stages, 'total', 'octomap_ms', 'reason'])
        warm = [float(row['total']) for row in rows[5:]]
        self.assertAlmostEqual(summary['time_ms']['mean'], sum(warm) / len(warm), places=9)
        self.assertEqual(summary['time_ms']['median'], sorted(warm)[len(warm) // 2])
        self.assertEqual(summary['time_ms']['max'], max(warm))
        self.assertEqual(int(rows[-1]['surfels']), summary['surfels']['total'])
        stamps = [float(row['stamp']) for row in rows]
        self.assertEqual(stamps, sorted(set(stamps)))
        self.assertGreater(summary['memory_mb']['peak_rss'], summary['surfels']['map_bytes'] / 1e6)

    def test_verdicts_are_those_of_the_score(self):
        verdicts = numpy.fromfile(os.path.join(self.report, 'verdicts.bin'), dtype=numpy.uint8)
        summary = read_json(self.report)
        self.assertEqual(len(verdicts), summary['surfels']['total'])
        for code, name in enumerate(['right', 'buried', 'floating', 'flipped']):
            self.assertAlmostEqual((verdicts == code).mean(), summary['exact'][name], places=9)

    def test_sweep_has_a_point_for_each_value(self):
        sweep = read_json(self.report, 'sweep.json')
        self.assertEqual(sweep['parameter'], 'th_d')
        self.assertEqual([point['value'] for point in sweep['values']], [0.2, 0.4])
        summary = read_json(self.report)
        self.assertEqual(sweep['values'][1]['exact'], summary['exact'])  # 0.4 is the configured value, and the map is the same every time
        self.assertEqual(sweep['values'][1]['octomap']['fdr'], summary['octomap']['fdr'])
        self.assertNotEqual(sweep['values'][0]['surfels'], sweep['values'][1]['surfels'])

    def test_page_is_self_contained(self):
        with open(os.path.join(self.report, 'report.html'), encoding='utf-8') as file:
            page = file.read()
        sources = re.findall(r'(?:src|href)="([^"]{0,30})', page)
        self.assertTrue(all(source.startswith('data:image/') for source in sources), sources)
        kinds = [source.split(';')[0] for source in sources]
        self.assertEqual(kinds.count('data:image/png'), 4)  # map and OctoMap, from outside and inside
        self.assertEqual(kinds.count('data:image/svg+xml'), 3)  # time, size, sweep
        self.assertIn(f"{read_json(self.report)['surfels']['total']:,}".replace(',', '\u202f'), page)

    def test_errors_have_a_colour_of_their_own(self):
        with open(os.path.join(self.report, 'report.html'), encoding='utf-8') as file:
            pictures = re.findall(r'data:image/png;base64,([^"]+)', file.read())
        share = []
        for picture in pictures:
            red, green, blue, _ = numpy.moveaxis(matplotlib.image.imread(io.BytesIO(base64.b64decode(picture))), 2, 0)
            share.append(((red > green + 0.3) & (blue > green + 0.3)).mean())
        wrong = 1 - read_json(self.report)['exact']['right']
        self.assertGreater(wrong, 0.001)
        self.assertGreater(share[0] + share[1], 0, 'the map has errors')
        self.assertEqual(share[2:], [0, 0], "OctoMap's boundary is not judged")

    def test_octomap_resolution_is_automatic_and_told(self):
        report = os.path.join(self.folder.name, 'automatic')
        result = run(self.room, '--report', report, '--set', 'decimation=8', '--no-exact', '--last', 2)
        self.assertEqual(result.returncode, DONE, result.stderr)
        octomap = read_json(report)['octomap']
        with open(os.path.join(self.room, 'camera.txt'), encoding='utf-8') as file:
            fx, fy = map(float, [line for line in file if not line.startswith('#')][0].split()[:2])
        self.assertAlmostEqual(octomap['resolution'], 8 * 3 / min(fx, fy), places=9)
        self.assertEqual(octomap['resolution'], octomap['pixel_spacing'])

    def test_what_is_switched_off_is_absent_and_old_files_are_removed(self):
        report = os.path.join(self.folder.name, 'reused')
        os.mkdir(report)
        for name in ('octomap.ply', 'sweep.json', 'verdicts.bin'):
            with open(os.path.join(report, name), 'w', encoding='utf-8') as file:
                file.write('of an earlier run')
        result = run(self.room, '--report', report, '--set', 'decimation=8', '--octomap-resolution', 0, '--no-exact', '--first', 2,
                     '--last', 8, '--stride', 3)
        self.assertEqual(result.returncode, DONE, result.stderr)
        self.assertEqual(sorted(os.listdir(report)), ['frames.csv', 'report.html', 'summary.json', 'surfels.ply', 'trajectory.txt'])
        summary = read_json(report)
        self.assertEqual(summary['input']['frames'], 3)
        self.assertNotIn('octomap', summary)
        self.assertNotIn('exact', summary)
        self.assertNotIn('octomap_ms', read_rows(report)[0])
        self.assertEqual(read_surfels(report).size, summary['surfels']['total'])

    def test_report_of_an_incomplete_folder_is_refused(self):
        script = os.path.join(SOURCES, 'scripts', 'replay_report.py')
        result = subprocess.run([script, self.room], capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, FAILED)
        self.assertRegex(result.stderr, r'^replay_report: [^\n]*summary\.json[^\n]*\n$')

    def test_nothing_usable_is_an_error(self):
        result = run(self.room, '--report', os.path.join(self.folder.name, 'nothing'), '--first', FRAMES + 5)
        self.assertEqual(result.returncode, FAILED, result.stderr)
        self.assertRegex(result.stderr, r'^replay_score: [^\n]*room[^\n]*\n$')

    def start_and_interrupt(self, report):
        """Starts a run that would take minutes, because its OctoMap is very fine."""
        process = subprocess.Popen([PROGRAM, self.room, '--report', report, '--no-exact', '--octomap-resolution', '0.01'],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 60
        while not os.path.exists(report) and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        return process

    def test_second_interrupt_ends_at_once(self):
        process = self.start_and_interrupt(os.path.join(self.folder.name, 'ended'))
        time.sleep(0.05)  # two pending signals would be delivered as one
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=5)
        self.assertEqual(process.returncode, -signal.SIGINT)

    def test_interrupt_keeps_what_was_done(self):
        report = os.path.join(self.folder.name, 'interrupted')
        process = self.start_and_interrupt(report)
        _, errors = process.communicate(timeout=200)
        self.assertEqual(process.returncode, DONE, errors)
        frames = read_json(report)['input']['frames']
        self.assertTrue(1 <= frames < FRAMES, frames)
        self.assertIn(f'Stopped after {frames} frame', errors)
        self.assertEqual(len(read_rows(report)), frames)
        self.assertEqual(len(read_surfels(report)), read_json(report)['surfels']['total'])
        self.assertTrue(os.path.exists(os.path.join(report, 'report.html')))


class MapFolder(unittest.TestCase):
    """A recording of two walls, so far from each other that only the second one is in memory at the end."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.recording, self.report, self.kept = (os.path.join(self.folder.name, name) for name in ('walls', 'report', 'kept'))
        os.makedirs(os.path.join(self.recording, 'depth'))
        for frame in range(2):
            Picture.fromarray(numpy.full((60, 80), 2750, dtype=numpy.uint16)).save(os.path.join(self.recording, 'depth', f'{frame:04}.png'))
        for name, text in (('camera.txt', '70 70 39.5 29.5 80 60\n'), ('poses.txt', '0 0 0 0 0 0 0 1\n1 200 0 0 0 0 0 1\n')):
            with open(os.path.join(self.recording, name), 'w', encoding='utf-8') as file:
                file.write(text)

    def replay(self, *more):
        return run(self.recording, '--report', self.report, '--set', f'map_folder={self.kept}', '--set', 'eviction_radius=10',
                   '--set', 'decimation=1', '--no-exact', *more)

    def test_the_report_has_the_whole_map(self):
        result = self.replay()
        self.assertEqual(result.returncode, DONE, result.stderr)
        surfels = read_surfels(self.report)
        self.assertGreater(min((surfels['x'] < 100).sum(), (surfels['x'] > 100).sum()), 1000)
        self.assertEqual(read_json(self.report)['surfels']['total'], len(surfels))
        with self.subTest('the map of another run is not scored as that of this recording'):
            again = self.replay()
            self.assertEqual(again.returncode, FAILED, again.stdout)
            self.assertRegex(again.stderr, 'kept.*already has a map.*another')

    def delete_before_the_third_frame(self, *later):
        """The result of a run whose map folder is deleted before the third frame, which is none. @param later  x of the poses that follow"""
        os.rename(os.path.join(self.recording, 'poses.txt'), os.path.join(self.recording, 'groundtruth.txt'))
        with open(os.path.join(self.recording, 'groundtruth.txt'), 'a', encoding='utf-8') as file:
            file.writelines(f'{2 + n} {x} 0 0 0 0 0 1\n' for n, x in enumerate([200, *later]))
        with open(os.path.join(self.recording, 'depth.txt'), 'w', encoding='utf-8') as file:
            file.write('0 depth/0000.png\n1 depth/0001.png\n2 fifo.png\n')
            file.writelines(f'{3 + n} depth/0001.png\n' for n in range(len(later)))
        fifo = os.path.join(self.recording, 'fifo.png')  # replay_score waits here until somebody writes
        os.mkfifo(fifo)

        def delete():
            with open(fifo, 'wb'):
                shutil.rmtree(self.kept)

        threading.Thread(target=delete, daemon=True).start()  # waits for ever if replay_score fails before
        result = self.replay('--octomap-resolution', 0)
        self.assertEqual(result.returncode, FAILED, result.stderr)
        return result

    def test_a_folder_that_is_deleted_meanwhile(self):
        result = self.delete_before_the_third_frame()
        sentence = f'The map folder lacks a part of the map. The map folder {self.kept} has been deleted, moved or replaced'
        self.assertIn(f'replay_score: {sentence}', result.stderr)
        self.assertIn(sentence, ' '.join(read_json(self.report)['warnings']), 'the report is written all the same')
        self.assertGreater(len(read_surfels(self.report)), 2000)

    def test_a_frame_that_is_refused_because_of_the_folder_ends_the_run_with_a_report(self):
        result = self.delete_before_the_third_frame(300, 400, 500, 600)
        self.assertRegex(result.stderr, r'\nreplay_score: The map ends after [234] frames, and the map folder [^\n]*has been deleted[^\n]*\n$')
        self.assertRegex(result.stdout, 'WARNING +The map ends after [234] frames')
        summary = read_json(self.report)
        self.assertIn(summary['input']['frames'], (2, 3, 4))
        self.assertIn('The map ends after', ' '.join(summary['warnings']))
        self.assertIn('report.html', os.listdir(self.report))
        self.assertGreater(len(read_surfels(self.report)), 1000)


class ReadmePicture(unittest.TestCase):
    """README's picture."""

    def blue_share(self, panel):
        """Share of frontier among the pixels that show surfels."""
        red, green, blue = (panel[..., n].astype(int) for n in range(3))
        drawn = (panel.min(axis=2) < 240)
        return ((blue > red + 50) & (blue > green + 30) & drawn).sum() / drawn.sum()

    def test_frontier_shrinks(self):
        script = os.path.join(SOURCES, 'scripts', 'exploration_picture')
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'picture.png')
            result = subprocess.run([script, os.path.dirname(PROGRAM), path, '--frames', '48'], capture_output=True, text=True, timeout=500)
            self.assertEqual(result.returncode, DONE, result.stderr)
            picture = (255 * matplotlib.image.imread(path)[..., :3]).round()
        self.assertEqual(picture.shape[1], 640)
        rows = range(30, 250), range(290, 510)
        first, last = (picture[rows[n]][:, 320 * n + 5:320 * n + 315] for n in range(2))
        self.assertGreater(self.blue_share(first), 0.3)
        self.assertLess(self.blue_share(last), self.blue_share(first) / 2)

    def test_failure_is_one_sentence(self):
        result = subprocess.run([os.path.join(SOURCES, 'scripts', 'exploration_picture'), '/no-such-folder', '/no-such-folder/picture.jpg'],
                                capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, FAILED)
        self.assertRegex(result.stderr, r'^exploration_picture: [^\n]*no-such-folder[^\n]*\n$')


if __name__ == '__main__':
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    PROGRAM, MAKE_SYNTHETIC = map(os.path.abspath, sys.argv[1:])
    unittest.main(argv=sys.argv[:1], verbosity=2)
