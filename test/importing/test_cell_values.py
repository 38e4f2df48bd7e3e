# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Numbers and times of cells, and the sentences about cells that are neither."""

import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportOptions


def imported(tmp_path, text, **options):
    file = tmp_path / 'a.csv'
    file.write_text(text)
    return import_file(file, ImportOptions(**options))


@pytest.mark.parametrize(
    ('cell', 'sentence'),
    [
        ('', "the cell of 'y [mm]' is empty"),
        ('  ', "the cell of 'y [mm]' is empty"),
        ('nan', "'nan' is no number (y [mm])"),
        ('-Inf', "'-Inf' is no number (y [mm])"),
        ('1e999', "'1e999' is no number (y [mm])"),
        ('1e200', "'1e200' is no number (y [mm])"),
        ('1_0', "'1_0' is no number (y [mm])"),
        ('\u0661', "'\u0661' is no number (y [mm])"),
        ('0x10', "'0x10' is no number (y [mm])"),
        ('1.5\x85', "'1.5\\x85' is no number (y [mm])"),
        ('#DIV/0!', "'#DIV/0!' is no number (y [mm])"),
        ("1'234", '"1\'234" is no number (y [mm])'),
    ],
)
def test_a_cell_that_is_no_number_is_named_by_its_line(tmp_path, cell, sentence):
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, f'x [mm];y [mm];z [mm]\n1;2;3\n\n4;{cell};6\n7;;8\n')
    assert str(caught.value) == f'line 4: {sentence}.'


def test_the_first_row_that_is_wrong_is_named(tmp_path):
    with pytest.raises(BrokenFile, match=r"^line 3: 'b' is no number"):
        imported(tmp_path, 'x [mm];y [mm];z [mm]\n1;2;3\n1;2;b\na;2;3\n')


@pytest.mark.parametrize(
    ('rows', 'sentence'),
    [
        ('1.234,5;2;3', "line 2: '1.234,5' has thousands separators; leave them out."),
        ('1;2;3\n1,234.5;2;3', "line 3: '1,234.5' has thousands separators; leave them out."),
        ('1,234,567;2;3', "line 2: '1,234,567' has thousands separators; leave them out."),
        (
            '1,5;2;3\n1;2.5;3',
            "line 3: '2.5' has a decimal point, but '1,5' at line 2 a decimal comma; write points "
            'everywhere.',
        ),
        (
            '9;2;1,234\n1;2;3',
            "line 2: '1,234' can be 1234 or 1.234; write it without thousands separators and with "
            'a decimal point.',
        ),
    ],
)
def test_commas_that_can_mean_two_things_are_refused(tmp_path, rows, sentence):
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, f'x [mm];y [mm];z [mm]\n{rows}\n')
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    ('rows', 'x'),
    [
        # A number that begins with 0, has four decimals, or two, has no thousands.
        ('0,234;2,345;3,456', 0.000234),
        ('1,2345;2,345;3,456', 0.0012345),
        ('1,23;2,345;3,456', 0.00123),
        # 412 m are too far.
        ('412,250;133,300;487,900', 0.41225),
    ],
)
def test_decimal_commas_that_are_certain_are_read(tmp_path, rows, x):
    found = imported(tmp_path, f'x [mm];y [mm];z [mm]\n{rows}\n')
    assert found.goal.waypoints[0].pose.position[0] == pytest.approx(x)


@pytest.mark.parametrize(
    ('title', 'first', 'second', 'seconds'),
    [
        ('t', '62.56', '64.06', 1.5),
        ('timestamp', '1700000000.25', '1700000001.75', 1.5),
        ('timestamp', '1700000000123', '1700000001623', 1.5),
        ('timestamp', '1700000000123456', '1700000001623456', 1.5),
        ('timestamp', '1700000000123456789', '1700000001623456789', 1.5),
        ('time [ms]', '20', '1520', 1.5),
        ('t_us', '20', '1500020', 1.5),
        ('Time (Seconds)', '-0.5', '1', 1.5),
        ('time [min]', '1', '1.5', 30.0),
        ('time', '2026-03-04T10:00:00.125Z', '2026-03-04T10:00:01.625Z', 1.5),
        ('time', '2026-03-04 23:59:59', '2026-03-05 00:00:01', 2.0),
        ('time', '2026-03-04T10:00:00+01:00', '2026-03-04T09:00:01+00:00', 1.0),
        ('time', '10:00:00,125', '10:00:01,625', 1.5),
    ],
)
def test_times_count_from_the_first_point(tmp_path, title, first, second, seconds):
    found = imported(tmp_path, f'{title};x [m];y [m];z [m]\n{first};0;0;0\n{second};0.1;0;0\n')
    assert found.goal.waypoints.times.tolist() == pytest.approx([0.0, seconds], abs=1e-6)


def test_the_unit_of_a_unix_time_is_said(tmp_path):
    rows = '1700000000123,0,0,0\n1700000001123,0.1,0,0\n'
    said = [r.text() for r in imported(tmp_path, 't,x [m],y [m],z [m]\n' + rows).remarks]
    assert "the times of 't': read as ms since 1970" in said
    said = [r.text() for r in imported(tmp_path, 't [ms],x [m],y [m],z [m]\n' + rows).remarks]
    assert not any('since 1970' in text for text in said)


@pytest.mark.parametrize(
    ('stamp', 'next_stamp', 'seconds'),
    [
        ('4102444800', '4102444800.5', None),
        ('4102444700', '4102444700.5', 0.5),
        ('946684800000', '946684800500', 0.5),  # 2000 in ms
        ('1767225600000000', '1767225600500000', 0.5),
        ('1767225600000000000', '1767225600500000000', 0.5),
        ('85123456789012', '85123956789012', None),  # a day of ns
        ('851234567890', '851234667890', None),  # ten days of us
        ('638712345000000000', '638712345005000000', None),  # .NET: 100 ns since the year 1
        ('133712345000000000', '133712345005000000', None),  # Windows: 100 ns since 1601
    ],
)
def test_a_time_without_a_unit_is_of_this_century(tmp_path, stamp, next_stamp, seconds):
    text = f'stamp,x [m],y [m],z [m]\n{stamp},0,0,0\n{next_stamp},0.1,0,0\n'
    if seconds is None:
        with pytest.raises(BrokenFile) as caught:
            imported(tmp_path, text)
        assert str(caught.value) == (
            f'line 3: the time {next_stamp} has no unit, and is of no year from 2000 to 2100 in '
            's, ms, us or ns; write the unit, such as stamp [ns].'
        )
        text = text.replace('stamp,', 'stamp [ns],')
        seconds = 1e-9 * (float(next_stamp) - float(stamp))
    times = imported(tmp_path, text).goal.waypoints.times
    assert times[1] - times[0] == pytest.approx(seconds, rel=1e-3)


@pytest.mark.parametrize(
    ('cell', 'sentence'),
    [
        ('01:30', "'01:30' is no number (time)"),
        ('25:00:00', "'25:00:00' is no time such as 2026-03-04T10:00:00.125"),
        ('04.03.2026 10:00:00', "'04.03.2026 10:00:00' is no time such as"),
    ],
)
def test_a_time_that_cannot_be_read_is_refused(tmp_path, cell, sentence):
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, f'time;x [m];y [m];z [m]\n{cell};0;0;0\n')
    assert str(caught.value).startswith(f'line 2: {sentence}')


@pytest.mark.parametrize(
    ('header', 'row', 'sentence'),
    [
        ('qx,qy,qz,qw', '0,0,0,0.5', 'the quaternion has the length 0.5, but must have 1'),
        ('rx,ry,rz', '0,90,0', 'a turn of 90 rad is more than two turns; if it is in degrees'),
        ('roll [rad],pitch [rad],yaw [rad]', '0,0,-45', 'a turn of 45 rad is more than two'),
        ('speed [m/s]', '0', 'the speed is 0; leave the column out, or write a number above 0'),
        ('blend [mm]', '-1', 'the blend is -0.001; leave the column out, or write 0 or more'),
    ],
)
def test_a_number_that_cannot_be_meant_is_refused(tmp_path, header, row, sentence):
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, f'x [m],y [m],z [m],{header}\n0,0,0,{row}\n')
    assert str(caught.value).startswith(f'line 2: {sentence}')


@pytest.mark.parametrize(
    ('first', 'second', 'sentence'),
    [
        ('08:00:00', '12', "'12' is no time such as 08:00:00 before it"),
        ('08:00:00', '2026-03-04T10:00:00', "'2026-03-04T10:00:00' is no time such as 08:00:00"),
        ('2026-03-04 10:00:00', '2026-03-05', "'2026-03-05' is no time such as 2026-03-04 10:00"),
        ('12', '08:00:00', "'08:00:00' is no number (time)"),
    ],
)
def test_the_times_of_a_column_have_one_notation(tmp_path, first, second, sentence):
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, f'time;x [m];y [m];z [m]\n{first};0;0;0\n{second};1;0;0\n')
    assert str(caught.value).startswith(f'line 3: {sentence}')


def test_the_largest_time_tells_the_unit_of_a_column(tmp_path):
    rows = '0;0;0;0\n1700000000123;0.1;0;0\n1700000001623;0.2;0;0\n'
    found = imported(tmp_path, 't;x [m];y [m];z [m]\n' + rows)
    times = found.goal.waypoints.times
    assert times[2] - times[1] == pytest.approx(1.5)
