#!/usr/bin/python3
"""Tests make_synthetic's truth/ and its errors, and replay_score --truth.

usage: test_replay_truth.py REPLAY_SCORE MAKE_SYNTHETIC
"""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy
import PIL.Image

import test_replay_score
from test_replay_score import DONE, FAILED, WRONG_USAGE, read_json, run


def make(folder, *arguments):
    result = subprocess.run([test_replay_score.MAKE_SYNTHETIC, folder, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert result.returncode == DONE, result.stderr
    return folder


def depth_of(folder, frame):
    """[m]"""
    for ending, unit in (('png', 1e-3), ('tiff', 1)):
        path = os.path.join(folder, 'depth', f'{frame:06}.{ending}')
        if os.path.exists(path):
            return numpy.array(PIL.Image.open(path)) * unit
    raise FileNotFoundError(folder)


def poses_of(folder):
    return numpy.loadtxt(os.path.join(folder, 'poses.txt'))


class WithFolder(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = folder.name

    @classmethod
    def path(cls, name):
        return os.path.join(cls.folder, name)


class Judged(WithFolder):
    """Recordings of 160x120 pixels, mapped as they are."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        small = ['--size', '160x120']
        cls.clean = make(cls.path('clean'), '--frames', 8, *small)
        cls.noisy = make(cls.path('noisy'), '--frames', 8, '--noise', *small)
        cls.shaken = make(cls.path('shaken'), '--frames', 8, '--pose-noise', '0.02,1', *small)

    def summary(self, recording, *arguments, truth=None):
        self.report = os.path.join(self.folder, 'report')
        self.result = run(recording, '--truth', truth or os.path.join(recording, 'truth'), '--report', self.report, '--set', 'decimation=1', *arguments)
        self.assertEqual(self.result.returncode, DONE, self.result.stderr)
        return read_json(self.report)

    def assert_same(self, a, b, names=None):
        """Equal up to what rounding to millimetres does."""
        for name in names or a:
            self.assertAlmostEqual(a[name], b[name], delta=0.02, msg=name)

    def test_without_errors_it_says_what_the_exact_test_says(self):
        for decimation in (1, 2):
            summary = self.summary(self.clean, '--octomap-resolution', 0.06, '--set', f'decimation={decimation}')
            self.assertEqual(summary['input']['truth'], os.path.join(self.clean, 'truth'))
            self.assertGreater(summary['truth']['right'], 0.97)
            self.assert_same(summary['truth'], summary['exact'])
            self.assert_same(summary['octomap']['truth'], summary['octomap']['exact'], ['right', 'fdr_2cm', 'miss_5cm'])
            self.assertRegex(self.result.stdout, r'\ntruth +right 9\d\.\d\d %;.*\n')
            self.assertRegex(self.result.stdout, r'\nOctoMap .*\n +exact test: right .*\n +truth: right .*\n')
        with open(os.path.join(self.report, 'report.html'), encoding='utf-8') as file:
            self.assertIn('OctoMap by the truth', file.read())

    def test_it_sees_the_errors_that_the_exact_test_cannot_see(self):
        for recording in (self.noisy, self.shaken):
            summary = self.summary(recording, '--octomap-resolution', 0)
            self.assertGreater(summary['exact']['right'], 0.95)
            self.assertLess(summary['truth']['right'], summary['exact']['right'] - 0.02)
            self.assertGreater(summary['truth']['miss_2cm'], summary['exact']['miss_2cm'])

    def test_the_exact_test_is_the_same_without_a_truth(self):
        as_recorded = ['--octomap-resolution', 0, '--set', 'correct_poses=false']
        with_truth = self.summary(self.noisy, *as_recorded, truth=self.noisy)
        self.assertEqual(with_truth['truth'], with_truth['exact'], 'the recording itself is a truth')
        result = run(self.noisy, '--report', self.report, '--set', 'decimation=1', *as_recorded)
        self.assertEqual(result.returncode, DONE, result.stderr)
        without = read_json(self.report)
        self.assertEqual(with_truth['exact'], without['exact'])
        self.assertNotIn('truth', without)
        self.assertNotIn('truth', result.stdout)

    def test_it_can_be_the_only_judge(self):
        summary = self.summary(self.clean, '--octomap-resolution', 0.06, '--no-exact')
        self.assertNotIn('exact', summary)
        self.assertNotIn('exact', summary['octomap'])
        self.assertIn('truth', summary['octomap'])
        self.assertGreater(summary['truth']['right'], 0.97)
        self.assertNotIn('exact test', self.result.stdout)

    def test_parts_of_a_recording_have_the_same_part_of_the_truth(self):
        summary = self.summary(self.clean, '--octomap-resolution', 0, '--first', 1, '--last', 6, '--stride', 2)
        self.assertEqual(summary['input']['frames'], 3)
        self.assert_same(summary['truth'], summary['exact'])

    def test_frames_of_a_bag_have_their_truth(self):
        to_bag, bag = os.path.join(os.path.dirname(test_replay_score.PROGRAM), 'sequence_to_bag'), self.path('clean.bag')
        if not os.path.exists(to_bag):
            self.skipTest('a build without ROS')
        subprocess.run([to_bag, self.clean, bag], check=True, stdout=subprocess.DEVNULL, timeout=60)
        summary = self.summary(bag, '--octomap-resolution', 0, '--first', 2, '--stride', 3, truth=os.path.join(self.clean, 'truth'))
        self.assert_same(summary['truth'], summary['exact'])
        wrong = run(bag, '--truth', make(self.path('stops'), '--frames', 5, '--size', '160x120'), '--report', self.path('refused'))
        self.assertEqual(wrong.returncode, FAILED)
        self.assertRegex(wrong.stderr, r'^replay_score: --truth: [^\n]* must have the same frames as the recording, but frame 1 has [^\n]*\n$')

    def test_sweeps_have_it_as_well(self):
        self.summary(self.clean, '--octomap-resolution', 0, '--last', 3, '--sweep', 'z_max=2:3:2')
        values = read_json(self.report, 'sweep.json')['values']
        self.assertEqual(len(values), 2)
        for value in values:
            self.assert_same(value['truth'], value['exact'])
        self.assertEqual(values[1]['truth'], read_json(self.report)['truth'])

    def check_refused(self, sentence, truth, told=r''):
        report = self.path('refused')
        result = run(self.clean, '--truth', truth, '--report', report)
        self.assertEqual(result.returncode, FAILED)
        self.assertRegex(result.stdout, rf'^{told}$')
        self.assertRegex(result.stderr, rf'^replay_score: [^\n]*{sentence}[^\n]*\n$')
        self.assertFalse(os.path.exists(report))

    def test_mismatches_are_refused_before_anything_is_mapped(self):
        self.check_refused('--truth: there is no folder', self.path('nothing'))
        self.check_refused('is not a recording', self.folder)
        self.check_refused('it has 5 frames instead of 8', make(self.path('short'), '--frames', 5, '--size', '160x120'))
        self.check_refused('its camera has 80x60 pixels', make(self.path('small'), '--frames', 8, '--size', '80x60'))
        self.check_refused('has a pose .* away from the recorded one', make(self.path('other'), '--frames', 8, '--size', '160x120', '--path', 'explore'))
        damaged = shutil.copytree(os.path.join(self.clean, 'truth'), self.path('damaged'))
        with open(os.path.join(damaged, 'objects.json'), 'w', encoding='utf-8') as file:
            file.write('{}')
        self.check_refused(r'objects\.json is not as it must be', damaged)

    def test_a_truth_that_cannot_be_read_ends_the_run(self):
        damaged = shutil.copytree(os.path.join(self.clean, 'truth'), self.path('unreadable'))
        with open(os.path.join(damaged, 'depth', '000005.tiff'), 'w', encoding='utf-8') as file:
            file.write('no image')
        self.check_refused(r'000005\.tiff cannot be used', damaged, told=r'Device: [^\n]+\n')


class Things(WithFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        small = ['--size', '120x90', '--frames', 60]
        cls.results = {}
        for scene in ('box_vanishes', 'person_walks'):
            recording, report = make(cls.path(scene), '--scene', scene, *small), cls.path(scene + '_report')
            cls.results[scene] = run(recording, '--truth', os.path.join(recording, 'truth'), '--report', report, '--set', 'decimation=1',
                                     '--octomap-resolution', 0)
            assert cls.results[scene].returncode == DONE, cls.results[scene].stderr

    def objects(self, scene):
        return read_json(self.path(scene + '_report'))['objects']

    def test_a_box_that_is_there_from_the_start_is_on_the_map_and_goes(self):
        box, = self.objects('box_vanishes')
        stand, = box['stands']
        self.assertEqual((box['name'], stand['first'], stand['last']), ('box', 0, 29))
        for faces in stand['faces']:
            self.assertGreater(faces['points'], 1000)
            self.assertGreater(faces['early_points'], 100)
            self.assertGreater(faces['covered'], 0.9)
        self.assertEqual(box['left']['occupied'], 0)
        self.assertIn('most_left', box)
        stdout = self.results['box_vanishes'].stdout
        self.assertRegex(stdout, r'\nbox +frames 0 to 29, seen from \d+: faces with occupied surfels .* after 8 frames, (100|9\d)\.\d\d % \(0\.17\)')
        self.assertRegex(stdout, r'\n +left where it was: 0 occupied, \d+ frontier; at most \d+ and \d+ in any frame\n')
        with open(os.path.join(self.path('box_vanishes_report'), 'report.html'), encoding='utf-8') as file:
            self.assertIn('Things that come and go', file.read())

    def test_a_person_stands_nowhere(self):
        person, = self.objects('person_walks')
        self.assertEqual((person['name'], person['stands']), ('person', []))
        self.assertEqual(person['left']['occupied'], 0)

    def test_every_frame_has_its_truth(self):
        """The truth of a frame shows the box as long as it is there."""
        truth = os.path.join(self.path('box_vanishes'), 'truth')
        with open(os.path.join(truth, 'objects.json'), encoding='utf-8') as file:
            last = json.load(file)['objects'][0]['stands'][0]['last']
        alone = make(self.path('room'), '--path', 'arc', '--size', '120x90', '--frames', 60)
        for frame in (0, last - 1, last, last + 1, 59):
            differs = (abs(depth_of(truth, frame) - depth_of(os.path.join(alone, 'truth'), frame)) > 1e-6).mean()
            self.assertEqual(differs > 0.02, frame <= last, frame)


class Errors(WithFolder):
    def test_the_truth_has_none(self):
        tiny = ['--frames', 2, '--size', '160x120']
        clean = make(self.path('none'), *tiny)
        spoilt = make(self.path('all'), *tiny, '--noise', '--dropouts', 0.1, '--outliers', 0.1, '--flying', '--pose-noise', '0.01,1')
        for frame in range(2):
            truth = depth_of(os.path.join(spoilt, 'truth'), frame)
            self.assertEqual(truth.dtype, numpy.float32)
            self.assertTrue(numpy.isfinite(truth).all() and truth.min() > 0)
            self.assertTrue((truth == depth_of(os.path.join(clean, 'truth'), frame)).all())
            self.assertLess(abs(truth - depth_of(clean, frame)).max(), 0.51e-3)
            self.assertGreater((abs(truth - depth_of(spoilt, frame)) > 0.01).mean(), 0.15)
        self.assertTrue((poses_of(os.path.join(spoilt, 'truth')) == poses_of(clean)).all())
        self.assertGreater(abs(poses_of(spoilt) - poses_of(clean)).max(), 1e-3)

    def test_wrong_options_get_a_sentence(self):
        for arguments, sentence in [(['--outliers', '2'], "--outliers: must be a number from 0 to 1, not '2'."),
                                    (['--pose-noise', '0.003'], "--pose-noise: must be METRES,DEGREES of at most 0.1,5, such as 0.003,0.2, not '0.003'."),
                                    (['--pose-noise', '3,0.2'], "not '3,0.2'."), (['--pose-noise', '0.1,nan'], "not '0.1,nan'."),
                                    (['--pose-noise'], '--pose-noise needs a value.'),
                                    (['--scene', 'fire'], "--scene: must be room, box_appears, box_vanishes, box_returns or person_walks, not 'fire'."),
                                    (['--from', 'x', '--frames', '3'], '--frames: is for the room: leave it out, or leave out --from.'),
                                    (['--from', ''], '--from: must not be empty.')]:
            result = subprocess.run([test_replay_score.MAKE_SYNTHETIC, self.path('x'), *arguments], capture_output=True, text=True, timeout=60)
            with self.subTest(arguments=arguments):
                self.assertEqual(result.returncode, WRONG_USAGE, result.stderr)
                self.assertRegex(result.stderr, '^make_synthetic: [^\n]*' + re.escape(sentence) + '\n')
        missing = subprocess.run([test_replay_score.MAKE_SYNTHETIC, self.path('x'), '--from', self.path('y')], capture_output=True, text=True, timeout=60)
        self.assertEqual(missing.returncode, FAILED)
        self.assertRegex(missing.stderr, r"^make_synthetic: There is no folder or bag '[^\n]*y'\.\n$")

    def test_a_recording_can_be_spoilt_and_is_its_own_truth(self):
        recorded = make(self.path('recorded'), '--frames', 4, '--size', '160x120', '--noise', '--dropouts', 0.05)
        spoilt = make(self.path('spoilt'), '--from', recorded, '--outliers', 0.01)
        for frame in range(4):
            before, after = depth_of(recorded, frame), depth_of(spoilt, frame)
            self.assertTrue(numpy.allclose(depth_of(os.path.join(spoilt, 'truth'), frame), before, atol=1e-6))
            self.assertAlmostEqual((before != after).mean(), 0.01, delta=0.003)
        self.assertTrue(numpy.allclose(poses_of(spoilt), poses_of(recorded), atol=1e-12))
        result = run(spoilt, '--truth', recorded, '--report', self.path('report'), '--set', 'decimation=1', '--octomap-resolution', 0)
        self.assertEqual(result.returncode, DONE, result.stderr)
        summary = read_json(self.path('report'))
        self.assertLess(summary['truth']['right'], summary['exact']['right'])


if __name__ == '__main__':
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    test_replay_score.PROGRAM, test_replay_score.MAKE_SYNTHETIC = map(os.path.abspath, sys.argv[1:])
    unittest.main(argv=sys.argv[:1], verbosity=2)
