#!/usr/bin/python3
"""Tests what replay_score does if a recording, the disk or the user lets it down.

usage: test_replay_failures.py REPLAY_SCORE MAKE_SYNTHETIC
"""
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import numpy
import PIL.Image

import test_replay_score
from test_replay_score import DONE, FAILED, SOURCES, WRONG_USAGE, read_json, read_rows, run

NEW_FILES = ['frames.csv', 'summary.json', 'surfels.ply', 'trajectory.txt']  # of a run without scores, before its page is made


def small_disk(size):
    """For preexec_fn: files of this process can have `size` bytes only."""
    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # so that write() fails, as on a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    return limit


def read_folder(folder):
    content = {}
    for entry in os.scandir(folder):
        if entry.is_file():
            with open(entry.path, 'rb') as file:
                content[entry.name] = file.read()
    return content


class CommandLine(unittest.TestCase):
    def check(self, program, arguments, sentence):
        result = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, WRONG_USAGE, result.stderr)
        name = os.path.basename(program)
        self.assertRegex(result.stderr, f'^{name}: {sentence}\nUsage: {name} --help [^\n]*\n$')
        self.assertEqual(result.stdout, '')

    def test_unknown_options_come_first(self):
        for arguments, sentence in [(['room', '--reprt', 'x'], r'There is no option --reprt; did you mean --report\?'),
                                    (['--octomap_resolution=0'], r'There is no option --octomap_resolution; did you mean --octomap-resolution\?'),
                                    (['--first', '-5', '--xyzzyx'], r'There is no option --xyzzyx\.'),
                                    (['room'], r'--report is required')]:
            with self.subTest(arguments=arguments):
                self.check(test_replay_score.PROGRAM, arguments, sentence)

    def test_other_programs_do_the_same(self):
        self.check(test_replay_score.MAKE_SYNTHETIC, ['--frame', '3'], r'There is no option --frame; did you mean --frames\?')
        self.check(test_replay_score.MAKE_SYNTHETIC, [], r'OUT is required')
        to_bag = os.path.join(os.path.dirname(test_replay_score.PROGRAM), 'sequence_to_bag')
        if os.path.exists(to_bag):  # a build with ROS
            self.check(to_bag, ['room', 'x.bag', '--depht-topic', '/x'], r'There is no option --depht-topic; did you mean --depth-topic\?')

    def programs(self):
        """Name and path of those that are built."""
        folder = os.path.dirname(test_replay_score.PROGRAM)
        return {name: os.path.join(folder, name) for name in os.listdir(folder)}

    def test_empty_paths_are_refused(self):
        for program, arguments, name in [('replay_score', ['room', '--report', ''], '--report'), ('replay_score', ['', '--report', 'x'], 'INPUT'),
                                         ('replay_score', ['room', '--report', 'x', '--config', ''], '--config'), ('make_synthetic', [''], 'OUT'),
                                         ('sequence_to_bag', ['', 'x.bag'], 'FOLDER'), ('sequence_to_bag', ['room', ''], 'OUT.bag'),
                                         ('bench', [''], 'INPUT'), ('bench', ['--json', ''], '--json'), ('bench', ['--config', ''], '--config')]:
            if program in self.programs():
                with self.subTest(program=program, arguments=arguments):
                    self.check(self.programs()[program], arguments, name + r': must not be empty\.')
        self.check(os.path.join(SOURCES, 'scripts', 'exploration_picture'), ['', 'x.png'], r'PROGRAMS and PICTURE must not be empty\.')
        page = subprocess.run([os.path.join(SOURCES, 'scripts', 'replay_report.py'), ''], capture_output=True, text=True, timeout=60)
        self.assertEqual(page.returncode, WRONG_USAGE, page.stderr)

    def test_what_is_wrong_is_a_plain_sentence(self):
        there = ['room', '--report', 'x']
        for program, arguments, sentence in [
                ('replay_score', [*there, '--first', '-3'], "--first: must be a whole number from 0 to 2147483647, not '-3'."),
                ('replay_score', [*there, '--stride', '0'], "--stride: must be a whole number from 1 to 2147483647, not '0'."),
                ('replay_score', [*there, '--first'], '--first needs a value.'),
                ('replay_score', [*there, '--report', 'y'], '--report can be given only once.'),
                ('replay_score', [*there, '--set', 'decimation=0'], 'decimation is 0 pixel: it must be from 1 to 64 pixel.'),
                ('replay_score', [*there, '--set', 'sampling=median'], "sampling is 'median': it must be mean or nearest."),
                ('replay_score', [*there, '--set', 'noise=-0.001'], 'noise is -0.001 m: it must be from 0 to 1 m.'),
                ('replay_score', [*there, '--set', 'agreement=0'], 'agreement is 0: it must be from 0.001 to 0.5.'),
                ('replay_score', [*there, '--sweep', 'th_d'], "--sweep 'th_d' is not of the form PARAM=LO:HI:N, as in th_d=0.01:0.42:9."),
                ('make_synthetic', ['x', '--frames', 'many'], "--frames: must be a whole number from 1 to 999999, not 'many'."),
                ('make_synthetic', ['x', '--path', 'up'], "--path: must be orbit, explore, turn, walk, close, arc or watch, not 'up'."),
                ('make_synthetic', ['x', '--dropouts', 'nan'], "--dropouts: must be a number from 0 to 0.9, not 'nan'."),
                ('sequence_to_bag', ['x', 'x.bag', '--depth-unit', 'inf'], "--depth-unit: must be a number above 0, not 'inf'."),
                ('sequence_to_bag', ['x', 'x.bag', '--encoding', 'rgb8'], "--encoding: must be 32FC1 or 16UC1, not 'rgb8'."),
                ('bench', ['--row-seconds', '0'], "--row-seconds: must be a number above 0, not '0'.")]:
            if program in self.programs():
                with self.subTest(program=program, arguments=arguments):
                    self.check(self.programs()[program], arguments, re.escape(sentence))
        picture = os.path.join(SOURCES, 'scripts', 'exploration_picture')
        self.check(picture, ['x', 'x.png', '--frames', '3'], r'--frames must be 4 or more\.')
        self.check(picture, [], 'the following arguments are required: PROGRAMS, PICTURE')


class EarlierReport(unittest.TestCase):
    """A report stays as it is until the next one can take its place."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.room = os.path.join(cls.folder.name, 'room')
        subprocess.run([test_replay_score.MAKE_SYNTHETIC, cls.room, '--frames', '3', '--size', '160x120'], check=True, stdout=subprocess.DEVNULL)
        cls.report = os.path.join(cls.folder.name, "the user's report")
        cls.arguments = ['--report', cls.report, '--set', 'decimation=1', '--octomap-resolution', 0, '--no-exact']
        result = run(cls.room, *cls.arguments)
        assert result.returncode == DONE, result.stderr
        with open(os.path.join(cls.report, 'notes.txt'), 'w', encoding='utf-8') as file:
            file.write('of the user')
        cls.before = read_folder(cls.report)

    def check_kept(self, result):
        self.assertEqual(result.returncode, FAILED, result.stderr)
        self.assertRegex(result.stderr, r'^(Skipped [^\n]*\n|\.\.\. and [^\n]*\n)*replay_score: [^\n]*\n$')
        self.assertEqual(read_folder(self.report), self.before)

    def test_mistyped_recording(self):
        self.check_kept(run(self.room + 'x', *self.arguments))
        self.check_kept(run(self.room, *self.arguments, '--first', 100))

    def test_damaged_recordings(self):
        bag = os.path.join(self.folder.name, 'damaged.bag')
        with open(bag, 'wb') as file:
            file.write(b'#ROSBAG V2.0\n' + 5000 * b'x')
        self.check_kept(run(bag, *self.arguments))
        damaged = os.path.join(self.folder.name, 'damaged')
        shutil.copytree(self.room, damaged)
        for name in os.listdir(os.path.join(damaged, 'depth')):
            with open(os.path.join(damaged, 'depth', name), 'wb') as file:
                file.write(b'no image')
        self.check_kept(run(damaged, *self.arguments))

    def test_full_disk(self):
        self.check_kept(run(self.room, *self.arguments, preexec_fn=small_disk(len(self.before['surfels.ply']) // 2)))

    def test_a_failed_run_leaves_no_folder(self):
        report = os.path.join(self.folder.name, 'another')
        run(self.room + 'x', '--report', report)
        self.assertFalse(os.path.exists(report))

    def test_page_on_a_full_disk(self):
        script = os.path.join(SOURCES, 'scripts', 'replay_report.py')
        size = len(self.before['report.html']) // 2
        result = subprocess.run([script, self.report], capture_output=True, text=True, timeout=60, preexec_fn=small_disk(size))
        self.assertEqual(result.returncode, FAILED)
        self.assertRegex(result.stderr, r'^replay_report: [^\n]*File too large[^\n]*\n$')
        self.assertEqual(read_folder(self.report), self.before)

    def test_interrupted_page(self):
        script = os.path.join(SOURCES, 'scripts', 'replay_report.py')
        for delay in (0.05, 0.2, 0.5, 1):
            process = subprocess.Popen([script, self.report], stderr=subprocess.PIPE, text=True,
                                       preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}))
            time.sleep(delay)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
            self.assertEqual(errors, '', delay)
            self.assertIn(process.returncode, (-signal.SIGINT, DONE))
            self.assertEqual(sorted(read_folder(self.report)), sorted(self.before))

    def start(self, report):
        """Starts a run, and waits until it makes the page."""
        process = subprocess.Popen([test_replay_score.PROGRAM, self.room, '--report', report, *map(str, self.arguments[2:])], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, start_new_session=True)
        summary, children = os.path.join(report, 'unfinished_report', 'summary.json'), f'/proc/{process.pid}/task/{process.pid}/children'
        deadline = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < deadline:
            with open(children, encoding='utf-8') as file:
                if os.path.exists(summary) and file.read():
                    return process
            time.sleep(0.005)
        process.kill()
        self.fail(process.communicate())

    def check_new_files_are_beside(self, files=tuple(NEW_FILES)):
        """The earlier report stays as it is, and the new files are beside it."""
        unfinished = os.path.join(self.report, 'unfinished_report')
        self.addCleanup(shutil.rmtree, unfinished, ignore_errors=True)
        self.assertEqual(sorted(os.listdir(unfinished)), sorted(files))
        self.assertEqual(read_folder(self.report), self.before)

    def test_interrupt_while_the_first_page_is_made(self):
        report = os.path.join(self.folder.name, "another user's report")
        process = self.start(report)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, FAILED, errors)
        self.assertRegex(errors, r'^replay_score: report.html is not made, because of Ctrl-C[^\n]*\n$')
        self.assertEqual(sorted(os.listdir(report)), NEW_FILES)
        subprocess.run(errors.split('Try again with: ')[1], shell=True, check=True, timeout=60)
        self.assertIn('report.html', os.listdir(report))

    def test_interrupt_while_a_new_page_is_made(self):
        process = self.start(self.report)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, FAILED, errors)
        self.assertRegex(errors, r'^replay_score: report.html is not made, because of Ctrl-C; the earlier report stays, [^\n]*\n$')
        self.check_new_files_are_beside()
        subprocess.run(errors.split('Try again with: ')[1], shell=True, check=True, timeout=60)
        self.check_new_files_are_beside([*NEW_FILES, 'report.html'])

    def test_kill_while_a_new_page_is_made(self):
        process = self.start(self.report)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=60)
        unfinished = os.path.join(self.report, 'unfinished_report', 'report.html.unfinished')
        self.check_new_files_are_beside([*NEW_FILES, 'report.html.unfinished'] if os.path.exists(unfinished) else NEW_FILES)
        result = run(self.room, *self.arguments)  # and the next run clears this up
        self.assertEqual(result.returncode, DONE, result.stderr)
        self.assertEqual(sorted(read_folder(self.report)), sorted(self.before))
        type(self).before = read_folder(self.report)

    def test_page_program_that_fails_or_is_missing(self):
        with tempfile.TemporaryDirectory() as folder:
            copy = shutil.copy(test_replay_score.PROGRAM, folder)
            script = os.path.join(folder, 'replay_report.py')  # a program looks for it beside itself first
            for content, fault in [('raise SystemExit(1)', 'could not be made'), (None, 'needs the script')]:
                if content:
                    with open(script, 'w', encoding='utf-8') as file:
                        file.write(content)
                else:
                    os.remove(script)
                with self.subTest(fault=fault):
                    result = subprocess.run([copy, self.room, *map(str, self.arguments)], capture_output=True, text=True, timeout=60)
                    self.assertEqual(result.returncode, FAILED, result.stderr)
                    self.assertRegex(result.stderr, f'^replay_score: report.html {fault}[^\n]*; the earlier report stays, and [^\n]*\n$')
                    self.check_new_files_are_beside()


class NothingUsable(unittest.TestCase):
    """Recordings whose frames add nothing to a map: each has its reason, and a sentence that says what to do."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.room = os.path.join(self.folder.name, 'room')
        self.report = os.path.join(self.folder.name, 'report')
        subprocess.run([test_replay_score.MAKE_SYNTHETIC, self.room, '--frames', '3', '--size', '80x60'], check=True, stdout=subprocess.DEVNULL)

    def change_depth(self, change):
        for name in os.listdir(os.path.join(self.room, 'depth')):
            path = os.path.join(self.room, 'depth', name)
            depth = numpy.array(PIL.Image.open(path)).astype(int)
            PIL.Image.fromarray(change(depth).astype(numpy.uint16)).save(path)

    def run_room(self, *settings):
        return run(self.room, '--report', self.report, '--octomap-resolution', 0.05, '--set', *(settings or ['decimation=1']))

    def check_empty(self, result, reason, remedy):
        self.assertEqual(result.returncode, FAILED, result.stderr)
        self.assertRegex(result.stderr, r'^replay_score: The map of [^\n]* is empty. 3 of 3 depth images [^\n]*' + remedy + r'[^\n]*\n$')
        self.assertRegex(result.stdout, r'WARNING +3 of 3 depth images [^\n]*' + remedy)
        self.assertNotRegex(result.stdout, 'exact test|OctoMap')
        self.assertEqual([row['reason'] for row in read_rows(self.report)], 3 * [reason])
        summary = read_json(self.report)
        self.assertEqual(summary['reasons'], {reason: 3})
        self.assertNotIn('exact', summary)
        with open(os.path.join(self.report, 'report.html'), encoding='utf-8') as file:
            self.assertIn(remedy, file.read())

    def test_depths(self):
        for reason, remedy, change in [('no_measurement', 'camera delivers depth', lambda depth: 0 * depth),
                                       ('saturated', 'camera and its driver', lambda depth: 0 * depth + 65535),
                                       ('too_near', 'correct depth_unit', lambda depth: depth * 0 + 7),
                                       ('too_far', 'correct depth_unit', lambda depth: depth * 0 + 60000)]:
            with self.subTest(reason=reason):
                self.change_depth(change)
                self.check_empty(self.run_room(), reason, remedy)

    def test_depths_that_jump_from_pixel_to_pixel(self):
        def change(depth):
            rows, columns = numpy.indices(depth.shape)
            return 600 * 1.06 ** (5 * (columns % 5) + rows % 5)

        self.change_depth(change)
        self.check_empty(self.run_room('decimation=4'), 'no_agreement', 'set sampling: nearest')
        self.assertEqual(self.run_room('decimation=4', '--set', 'sampling=nearest').returncode, DONE)

    def test_still_camera(self):
        path = os.path.join(self.room, 'poses.txt')
        with open(path, encoding='utf-8') as file:
            lines = file.readlines()
        pose = lines[1].split(' ', 1)[1]
        with open(path, 'w', encoding='utf-8') as file:
            file.writelines(line.split(' ', 1)[0] + ' ' + pose for line in lines[1:])
        result = self.run_room()
        self.assertEqual(result.returncode, DONE, result.stderr)
        self.assertRegex(result.stdout, 'WARNING +The camera never moves: all 3 frames have the same pose [^\n]*poses.txt')
        self.assertEqual([row['reason'] for row in read_rows(self.report)], 3 * ['still_camera'])

    def test_summary_and_page_name_frame_date_and_version(self):
        result = self.run_room()
        self.assertEqual(result.returncode, DONE, result.stderr)
        self.assertNotIn('WARNING', result.stdout)
        summary = read_json(self.report)
        self.assertEqual((summary['warnings'], summary['reasons'], summary['skipped']), ([], {}, []))
        self.assertRegex(summary['date'], r'^20\d\d-\d\d-\d\dT\d\d:\d\d:\d\dZ$')
        self.assertRegex(summary['version'], r'^\d+\.\d+\.\d+$')
        self.assertEqual(summary['world_frame'], 'world of poses.txt')
        with open(os.path.join(self.report, 'report.html'), encoding='utf-8') as file:
            page = file.read()
        for text in (summary['date'], 'frontier_surfels ' + summary['version'], summary['world_frame']):
            self.assertIn(text, page)


if __name__ == '__main__':
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    test_replay_score.PROGRAM, test_replay_score.MAKE_SYNTHETIC = map(os.path.abspath, sys.argv[1:])
    unittest.main(argv=sys.argv[:1], verbosity=2)
