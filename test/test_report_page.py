#!/usr/bin/python3
"""Tests what the report's page says, for figures made up here."""
import html
import json
import os
import re
import sys
import tempfile
import unittest

import numpy

SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..')


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        sys.path.insert(0, os.path.join(SOURCES, 'scripts'))
        sys.dont_write_bytecode = True
        cls.report = __import__('replay_report')
        cls.plots = __import__('report_plots')

    def page(self, change=lambda summary: None, frames=12):
        time = {'mean': 10, 'median': 10, 'p95': 12, 'max': 15, 'rsd_percent': 5, 'stages': {'candidates': {'mean': 4, 'median': 4}}}
        share = {name: 0.25 for name in ('right buried floating flipped within_1v within_2v fdr_2cm fdr_5cm miss_1cm miss_2cm miss_5cm '
                                         'label_ok').split()}
        octomap = {'resolution': 0.02, 'pixel_spacing': 0.02, 'time_ms': {'mean': 60, 'median': 60}, 'cpu_ms': {'mean': 50, 'median': 50},
                   'memory_mb': 3, 'surfels': 9, 'fp': 1, 'fn': 1, 'fdr': 0.1, 'for': 0.49}
        summary = {'input': {'path': 'a/room', 'frames': frames, 'skipped': 0}, 'version': '1.2.3', 'date': '2020-01-01', 'world_frame': 'map',
                   'warnings': [], 'reasons': {}, 'notes': [], 'skipped': [], 'config': {'z_max': 3.0, 'refine_surfels': True},
                   'device': 'a device', 'surfels': {'total': 10, 'occupied': 5, 'frontier': 5, 'map_bytes': 160}, 'time_ms': time,
                   'cpu_ms': {'mean': 20, 'median': 20}, 'memory_mb': {'peak_rss': 1, 'device': 1}, 'octomap': octomap, 'exact': share}
        change(summary)
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, 'summary.json'), 'w', encoding='utf-8') as file:
                json.dump(summary, file)
            with open(os.path.join(folder, 'frames.csv'), 'w', encoding='utf-8') as file:
                file.write('stamp,surfels,created,removed,candidates,total\n' + '1,10,10,0,4,10\n' * frames)
            with open(os.path.join(folder, 'trajectory.txt'), 'w', encoding='utf-8') as file:
                file.write('1 0 0 0 0 0 0 1\n')
            return html.unescape(re.sub(r'\s+|data:[^"]*', ' ', self.report.page(folder)))

    def test_tables_have_no_column_of_dashes(self):
        for change in (lambda summary: None, lambda summary: summary.pop('octomap')):
            for table in re.findall('<table.*?</table>', self.page(change)):
                rows = [re.findall('<t[hd]>(.*?)</t[hd]>', row) for row in re.findall('<tr>.*?</tr>', table)]
                for column in zip(*rows):
                    self.assertNotEqual(set(column[1:]), {self.report.NONE}, column[0])
        self.assertIn('<th>OctoMap</th>', self.page())
        self.assertNotIn('<th>OctoMap</th>', self.page(lambda summary: summary.pop('octomap')))

    def test_stages_that_were_not_timed_are_left_out(self):
        page = self.page(lambda summary: summary['time_ms'].update(stages={}))
        self.assertNotIn('Time of the stages', page)
        self.assertNotIn('outside the stages', page)
        self.assertIn('outside the stages', self.page())

    def with_truth(self, summary):
        names = list(summary['exact'])
        summary['input']['truth'] = 'a/room/truth'
        for part, share in ((summary, 0.5), (summary['octomap'], 0.75)):
            part['truth'] = dict.fromkeys(names, share)
        summary['octomap']['exact'] = dict.fromkeys(names, 0.125)

    def rows(self, page):
        """The cells of all rows of all tables."""
        return [tuple(cell.strip() for cell in re.findall('<t[hd]>(.*?)</t[hd]>', row)) for row in re.findall('<tr>.*?</tr>', page)]

    def test_truth_stands_beside_the_exact_test(self):
        rows = self.rows(self.page())
        self.assertIn(('', 'of the surfels'), rows)
        self.assertIn(('No surfel within 2 cm', '25.0 %'), rows)
        self.assertNotIn('by the truth', self.page())
        page = self.page(self.with_truth)
        self.assertIn(('of the surfels', 'by the frames', 'by the truth', 'OctoMap by the frames', 'OctoMap by the truth'), self.rows(page))
        self.assertIn(('No surfel within 2 cm', '25.0 %', '50.0 %', '12.5 %', '75.0 %'), self.rows(page))
        self.assertIn('<code>a/room/truth</code>', page)
        self.assertRegex(page, '<b>50.0 %</b><i>right by the truth</i>')

        def truth_alone(summary):
            self.with_truth(summary)
            del summary['exact'], summary['octomap']
        page = self.page(truth_alone)
        self.assertIn(('of the boundary points', 'by the truth'), self.rows(page))
        self.assertNotIn('error of the exact test', page)

    def test_objects_have_their_tables(self):
        self.assertNotIn('come and go', self.page())

        def with_objects(summary):
            faces = [{'cosine': 0.17, 'early_points': 5, 'early_covered': 0.2, 'points': 9, 'covered': 0.6}, {'cosine': 0.1}]
            summary['objects'] = [
                {'name': 'box', 'stands': [{'first': 10, 'last': 50, 'first_seen': 12, 'faces': faces}]},
                {'name': 'person', 'stands': [], 'left': {'occupied': 3, 'frontier': 0}, 'most_left': {'occupied': 7, 'frontier': 1234}}]
        rows = self.rows(self.page(with_objects))
        self.assertIn(('box', '10 to 50', '12', '0.17', '20.0 %', '60.0 %'), rows)
        self.assertIn(('box', '10 to 50', '12', '0.1', self.report.NONE, self.report.NONE), rows)
        self.assertIn(('person', '3', '0', '7', '1 234'), rows)

    def test_speed_says_what_was_compared(self):
        self.assertRegex(self.page(), r"<b>2\.50 ×</b>.*?CPU time \(OctoMap's one thread\) against CPU time \(all threads of this program\)")
        self.assertRegex(self.page(lambda summary: summary.pop('cpu_ms')), r'<b>6\.00 ×</b>.*?Wall time against wall time')

    def test_gaps_of_octomap_are_told(self):
        told = "OctoMap's own gaps are counted as missing"
        self.assertNotIn(told, self.page())
        self.assertIn(told, self.page(lambda summary: summary['octomap'].update(resolution=0.01)))
        for text in ('Ψ are the surfels of this map', 'M is the boundary of an OctoMap', 'FDR (false discovery rate)', 'FOR (false omission rate)'):
            self.assertIn(text, self.page())

    def test_single_frames_do_not_flatten_the_stages(self):
        frames = numpy.ones(50, dtype=[('total', float)])
        frames['total'][0] = 3000
        self.assertLess(self.plots.top_of_stages(frames), 2)
        self.assertGreaterEqual(self.plots.top_of_stages(frames[:10]), 3000, 'of few frames, all count')
        self.assertEqual(self.plots.title_of_stages(frames[5:]), 'Stages')
        frames['total'][20] = 300  # a kernel is compiled
        self.assertLess(self.plots.top_of_stages(frames), 5)
        self.assertEqual(self.plots.title_of_stages(frames), 'Stages (2 of the frames took longer)')
        frames['total'][20:25] = 30
        self.assertGreaterEqual(self.plots.top_of_stages(frames), 30)


if __name__ == '__main__':
    unittest.main(verbosity=2)
