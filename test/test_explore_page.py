#!/usr/bin/python3
"""Tests the page about an exploration, and the figures in it, for explorations made up here."""
import contextlib
import html
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

import numpy

SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..')
SCRIPT = os.path.join(SOURCES, 'scripts', 'explore_report.py')
HEADER = 'strategy,views,metres,seconds,share,decision_ms,x,y,z\n'
VERTEX = numpy.dtype([(name, '<f4') for name in ('x', 'y', 'z', 'nx', 'ny', 'nz', 'radius')] +
                     [(name, 'u1') for name in ('red', 'green', 'blue', 'label')])


def rows(strategy, shares, metres=2.0, seconds=3.0, decisions=None):
    """Lines of the file: an image for each share, with the same way and time between two of them, along x."""
    decisions = decisions or [0] + [10 * n for n in range(1, len(shares))]
    return ''.join(f'{strategy},{n + 1},{metres * n},{seconds * n},{share},{decision},{0.5 + n},4,1.2\n'
                   for n, (share, decision) in enumerate(zip(shares, decisions)))


def patch(z, normal, rgb, label=1, low=(2, 2), high=(8, 6)):
    """Surfels on a horizontal square."""
    x, y = (part.ravel() for part in numpy.meshgrid(numpy.arange(low[0], high[0], 0.1), numpy.arange(low[1], high[1], 0.1)))
    surfels = numpy.zeros(len(x), VERTEX)
    surfels['x'], surfels['y'], surfels['z'], surfels['nz'], surfels['radius'], surfels['label'] = x, y, z, normal, 0.08, label
    for name, value in zip(('red', 'green', 'blue'), rgb):
        surfels[name] = value
    return surfels


def write_ply(path, surfels, seen=b''):
    """A map as Mapper::save() writes it, with the bytes of what has been seen behind the surfels."""
    with open(path, 'wb') as file:
        lines = ['ply', 'format binary_little_endian 1.0', f'element vertex {len(surfels)}']
        lines += [f'property {"uchar" if VERTEX[name] == numpy.uint8 else "float"} {name}' for name in VERTEX.names]
        lines += [f'element seen {len(seen)}', 'property uchar byte', 'end_header\n'] if seen else ['end_header\n']
        file.write('\n'.join(lines).encode('ascii') + surfels.tobytes() + seen)


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        sys.path.insert(0, os.path.join(SOURCES, 'scripts'))
        sys.dont_write_bytecode = True
        cls.report, cls.figures, cls.pictures = (__import__(name) for name in ('explore_report', 'explore_figures', 'explore_pictures'))

    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = os.path.join(self.temporary.name, 'kinect')
        os.mkdir(self.folder)
        self.addCleanup(self.temporary.cleanup)

    def path(self, name):
        return os.path.join(self.folder, name)

    def page(self, content):
        """(text of the page, explore.json)"""
        with open(self.path('exploration.csv'), 'w', encoding='utf-8') as file:
            file.write(content)
        self.report.make(self.folder)
        with open(self.path('explore.html'), encoding='utf-8') as page, open(self.path('explore.json'), encoding='utf-8') as figures:
            return html.unescape(re.sub(r'\s+|data:[^"]*', ' ', page.read())), json.load(figures)

    def cells(self, page):
        """The cells of all rows of all tables."""
        return [tuple(cell.strip() for cell in re.findall('<t[hd]>(.*?)</t[hd]>', row)) for row in re.findall('<tr>.*?</tr>', page)]

    def test_figures(self):
        content = HEADER + rows('random', [0.1 * n for n in range(10)] + [0.96])
        page, figures = self.page(content + rows('frontiers', [0.2, 0.5, 0.949, 0.95, 0.985], decisions=[0, 0, 10, 20, 60]))
        self.assertEqual(list(figures), ['frontiers', 'random'], 'ours comes first')
        self.assertEqual(figures['frontiers'], {'views_95': 4, 'metres_95': 6.0, 'seconds_95': 9.0, 'views': 5, 'metres': 8.0, 'seconds': 12.0,
                                                'share': 0.985, 'decision_ms_median': 20.0, 'decision_ms_p95': 56.0})
        self.assertEqual(figures['random']['views_95'], 11)
        self.assertEqual(figures['random']['decision_ms_median'], 55.0, 'the first look around is no decision')
        self.assertRegex(page, r'<b>4 views</b><i>frontier clusters</i><span>for 95 %, with 6\.00 m and 9\.00 s\. At the end 98\.5 % seen\. '
                               r'A decision takes 20\.0 ms \(median; 95 % are below 56\.0 ms\)\.</span>')
        self.assertRegex(page, r'<b>0\.364 ×</b><i>the views</i><span>of random free views, to reach 95 %; '
                               r'0\.300 × the metres and 0\.300 × the seconds\.</span>')
        self.assertIn(('frontier clusters', '4', '6.00', '9.00', '5', '8.00', '12.0', '98.5 %', '20.0', '56.0'), self.cells(page))
        self.assertIn(('random views', '0.364 ×', '0.300 ×', '0.300 ×'), self.cells(page))
        for text in ('kinect', 'Share seen of what can be seen', "The package's own planner", 'Goes to random positions', 'points'):
            self.assertIn(text, page)
        for text in ("OctoMap's frontier", 'The map as it grows', 'Grey: surfaces'):
            self.assertNotIn(text, page)

    def test_a_goal_that_is_not_reached(self):
        page, figures = self.page(HEADER + rows('frontiers', [0.5, 0.95]) + rows('nearest', [0.2, 0.3, 0.4, 0.5]))
        self.assertEqual([figures['nearest'][key] for key in ('views_95', 'metres_95', 'seconds_95', 'views', 'share')], [None, None, None, 4, 0.5])
        self.assertRegex(page, '<b>not reached</b><i>nearest frontier</i><span>95 % not reached in 4 views, 6.00 m and 9.00 s. At the end 50.0 %')
        none = self.report.NONE
        self.assertIn(('nearest frontier', 'not reached', none, none, '4', '6.00', '9.00', '50.0 %', '20.0', '29.0'), self.cells(page))
        self.assertIn(('nearest frontier', '< 0.500 ×', '< 0.333 ×', '< 0.333 ×'), self.cells(page), 'it needs more than all it took')
        self.assertIn('95 % was not reached there, so that it is less than this.', page)

        page, _ = self.page(HEADER + rows('frontiers', [0.5, 0.6]) + rows('nearest', [0.5, 0.96]))
        self.assertNotIn(' ×<', page, 'ours has not reached 95 %: nothing can be compared')
        page, _ = self.page(HEADER + rows('frontiers', [0.5, 0.6, 0.96]) + rows('nearest', [0.5, 0.6]))
        self.assertNotIn(' ×<', page, 'the other was stopped before ours had reached 95 %')

    def test_one_strategy_with_few_rows(self):
        for name, shares in (('frontiers', [0.3]), ('octomap', [0.97]), ('nearest', [0.1, 0.2]), ('random', [0])):
            with self.subTest(name=name):
                page, figures = self.page(HEADER + rows(name, shares))
                self.assertEqual([list(figures), figures[name]['share']], [[name], shares[-1]])
                self.assertEqual(figures[name]['views_95'], 1 if shares == [0.97] else None)
                self.assertEqual(figures[name]['decision_ms_p95'], None if len(shares) == 1 else 10.0)
                self.assertNotIn('as a multiple of', page)
                self.assertEqual('A decision takes' in page, len(shares) > 1)

    def test_film_strip(self):
        floor = patch(0, 1, (200, 0, 0))
        for name, seen in (('frontiers_0001.ply', b''), ('frontiers_0003.ply', b'seen'), ('octomap_0002.ply', b''), ('octomap_0001.ply', b'')):
            write_ply(self.path(name), floor, seen)
        others = ['frontiers_0009.ply', 'random_0001.ply', 'frontiers.ply', 'other_0001.ply']  # not of this exploration
        for name in others:
            write_ply(self.path(name), floor)
        page, _ = self.page(HEADER + rows('frontiers', [0.1, 0.2, 0.3456]) + rows('octomap', [0.1, 0.2]))
        titles = re.findall('<figcaption>([^<]*)</figcaption><img', page)
        self.assertEqual(titles, ['1 view, 0.0 m, 10.0 %', '3 views, 4.0 m, 34.6 %', '1 view, 0.0 m, 10.0 %', '2 views, 2.0 m, 20.0 %'])
        self.assertIn('Grey: surfaces', page)
        with open(self.path('explore.html'), encoding='utf-8') as file:
            self.assertEqual(file.read().count('src="data:image/png;base64,iVBOR'), 4)
        self.assertEqual(sorted(os.listdir(self.folder)), sorted(['exploration.csv', 'explore.html', 'explore.json', 'frontiers_0003.ply',
                                                                  'octomap_0002.ply', *others]), 'only the last map of each strategy stays')

    def test_pictures(self):
        camera = self.pictures.flat_camera()
        way = numpy.array([(3, 3, 0.5), (7, 3, 0.5)])

        def share_of(picture, red, green, blue):
            """Of the pixels whose colour points that way."""
            color = picture / numpy.maximum(picture.max(axis=2, keepdims=True), 1e-6)
            return (abs(color - numpy.array([red, green, blue])).max(axis=2) < 0.1).mean()

        floor, ceiling, frontier = patch(0, 1, (200, 0, 0)), patch(2.5, -1, (0, 200, 0)), patch(2.4, 1, (0, 0, 0), label=0)
        picture = self.pictures.map_picture(numpy.concatenate([floor, ceiling, frontier]), way, camera)
        self.assertEqual(picture.shape, (*self.pictures.PANEL[::-1], 3))
        self.assertGreater(share_of(picture, 1, 0, 0), 0.1, 'the floor is seen through the ceiling')
        self.assertEqual(share_of(picture, 0, 1, 0), 0)
        self.assertGreater(share_of(picture, 1, 0.6, 0.05), 0.002, 'the way')
        hidden = self.pictures.map_picture(patch(2.0, 1, (1, 1, 1), label=0), way, camera)
        self.assertGreater(share_of(hidden, 0.25 / 0.88, 0.5 / 0.88, 1), 0.1, 'frontier')
        self.assertGreater(numpy.count_nonzero(hidden[..., 0] > hidden[..., 2] + 0.1), 0.002 * hidden[..., 0].size, 'the way behind it')
        self.pictures.map_picture(floor[:0], way[:1], camera)  # an empty map

        plan = self.pictures.floor_plan(numpy.concatenate([patch(1, 1, (9, 9, 9), low=(2, 1), high=(3, 2)), patch(0, 1, (9, 9, 9)),
                                                           patch(1, 1, (9, 9, 9), label=0)]))
        self.assertEqual(plan.shape, (400, 500))
        y, x = numpy.nonzero(plan)
        self.assertTrue(98 <= x.min() < x.max() < 150 and 48 <= y.min() < y.max() < 100, 'only what was measured at this height')
        self.assertFalse(self.pictures.floor_plan(floor[:0]).any())

    def fault(self):
        """What the program says to the files in the folder; it must leave them as they are."""
        before, errors = sorted(os.listdir(self.folder)), io.StringIO()
        with mock.patch.object(sys, 'argv', ['explore_report.py', self.folder]), contextlib.redirect_stderr(errors):
            self.assertEqual(self.report.main(), 1)
        self.assertEqual(sorted(os.listdir(self.folder)), before)
        self.assertRegex(errors.getvalue(), r"^explore_report: the page of '[^\n]*kinect' could not be made: [^\n]*\n$")
        return errors.getvalue()

    def test_files_that_cannot_be_used(self):
        self.assertRegex(self.fault(), 'No such file.*exploration.csv')
        good = rows('frontiers', [0.1, 0.2])
        for content, sentence in [
                (b'', "exploration.csv' is empty"), (b'\x00\xff\xfe\x80', "exploration.csv' is no text"),
                (b'a,b\n1,2\n', 'the first line of .* is not strategy,views'),
                (HEADER, 'has no rows'), (HEADER + good + 'frontiers,3,4', "line 4 of .* has 3 values instead of 9"),
                (HEADER + good + '\n' + good, 'line 4 of .* has 1 values'),
                (HEADER + 'guesses,1,0,0,0,0,0,0,0\n', "line 2 of .* has the strategy 'guesses', which is none of frontiers, octomap, nearest, random"),
                (HEADER + 'random,1,0,0,0,0,0,0,0\n' + good + 'random,2,0,0,0,0,0,0,0\n', 'line 5 of .* goes on with random after another strategy'),
                (HEADER + good + good, 'line 4 of .* has fewer views'),
                *[(HEADER + good.replace(old, new), f'line 3 of .* has .* for {column}') for old, new, column in (
                    ('0.2,10', 'nan,10', 'share'), ('0.2,10', '1.5,10', 'share'), ('0.2,10', '0.2,inf', 'decision_ms'), ('s,2', 's,2.5', 'views'),
                    ('2.0,3.0', '-2.0,3.0', 'metres'), ('2.0,3.0', '2.0,', 'seconds'), ('1.5,4', '1.5,four', 'y'))]]:
            with self.subTest(sentence=sentence):
                with open(self.path('exploration.csv'), 'wb') as file:
                    file.write(content if isinstance(content, bytes) else content.encode('utf-8'))
                self.assertRegex(self.fault(), sentence)

    def test_maps_that_cannot_be_used(self):
        with open(self.path('exploration.csv'), 'w', encoding='utf-8') as file:
            file.write(HEADER + rows('frontiers', [0.1, 0.2]))
        write_ply(self.path('frontiers_0001.ply'), patch(0, 1, (200, 0, 0)))
        with open(self.path('frontiers_0001.ply'), 'rb') as file:
            whole = file.read()
        for content in (b'', b'ply\nend_header\n', whole[:-9], whole.replace(b'float nx', b'list nx'), whole.replace(b'float nx', b'float mx')):
            with open(self.path('frontiers_0002.ply'), 'wb') as file:
                file.write(content)
            self.assertRegex(self.fault(), r"frontiers_0002\.ply' is no map of surfels")

    def test_program(self):
        for arguments in ([], ['--help'], [''], ['a', 'b']):
            result = subprocess.run([SCRIPT, *arguments], capture_output=True, text=True, timeout=60, check=False)
            self.assertEqual([result.returncode, result.stdout], [2, ''])
            self.assertRegex(result.stderr, r'^usage: explore_report.py FOLDER\n')
        with open(self.path('exploration.csv'), 'w', encoding='utf-8') as file:
            file.write(HEADER + rows('frontiers', [0.1, 0.2]))
        result = subprocess.run([SCRIPT, self.folder], capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual([result.returncode, result.stdout, result.stderr], [0, '', ''])
        self.assertTrue(os.path.exists(self.path('explore.html')))


if __name__ == '__main__':
    unittest.main(verbosity=2)
