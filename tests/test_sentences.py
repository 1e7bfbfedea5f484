"""AIS sentences: what pyais reads back is what was reported, to the resolution of the wire."""

import math

import numpy as np
import pyais
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from usv_gym.sensors.sentences import (
    Station,
    encode,
    geodetic,
    position_report,
    quantise_cog,
    quantise_heading,
    quantise_position,
    quantise_rot,
    quantise_sog,
    static_reports,
    tag,
    wire_text,
)
from usv_gym.units import DEG, DEG_PER_MIN, KNOT, metres_per_degree
from usv_gym.world import state

THESIS = (
    "!AIVDM,1,1,,A,10000001AKPgsTbR0T:;Ka9MP6AP,0*40",
    "!AIVDM,1,1,,A,10000008AePgwGLR0eVIR7`aP5`l,0*55",
)
SHIP = Station(
    mmsi=257000001, ais_class=state.AIS_CLASS_A, kind=state.KIND_SHIP, name="Research ship", length=100, beam=16
)
ORIGIN = (59.4377744, 10.4716512)
METRES = metres_per_degree(ORIGIN[0])


def checksum_is_right(sentence):
    body, given_sum = sentence[1:].split("*")
    return f"{np.bitwise_xor.reduce(np.frombuffer(body.encode(), np.uint8)):02X}" == given_sum


def seconds_of_day(hour, minute, second):
    return (hour * 3600 + minute * 60 + second) * 1_000_000


@pytest.mark.parametrize("sentence", THESIS)
def test_the_sentences_of_the_thesis_are_encoded_again_from_their_values(sentence):
    assert encode(pyais.decode(sentence).asdict()) == [sentence]


@pytest.mark.parametrize(
    ("sentence", "report", "utc_us"),
    [
        (THESIS[0], (59.434733, 10.470648, 9.1, 292.6, 292, 1.0), seconds_of_day(18, 24, 46)),
        (THESIS[1], (59.438762, 10.483597, 10.9, 244.0, 244, (33 / 4.733) ** 2), seconds_of_day(13, 13, 20)),
    ],
)
def test_a_position_report_is_the_sentence_of_the_thesis(sentence, report, utc_us):
    """ROT 48.6 deg/min is code 33; the radio status 23092 is 13:13; manoeuvre 3 was never initialised in 2017."""
    lat, lon, sog, cog, heading, rot = report
    station = Station(0, state.AIS_CLASS_A, state.KIND_SHIP, "", 100, 16)
    fields = position_report(
        station, lat, lon, cog=cog * DEG, heading=heading * DEG, sog=sog * KNOT, rot=rot * DEG_PER_MIN, utc_us=utc_us
    )
    assert encode({**fields, "maneuver": 3}) == [sentence]
    assert fields["maneuver"] == 0


latitudes = st.floats(-90, 90)
longitudes = st.floats(-180, 180)
angles = st.floats(-10, 10)
speeds = st.floats(0, 60)
rates = st.floats(-0.3, 0.3)
times = st.integers(0, 4_000_000_000_000_000)


@given(st.sampled_from([1, 2]), latitudes, longitudes, angles, angles, speeds, rates, times)
@example(1, 90.0, 180.0, 2 * math.pi, 359.6 * DEG, 102.2 * KNOT, 708 * DEG_PER_MIN, 0)
@example(1, -90.0, -180.0, 359.96 * DEG, -1e-9, 200.0, -10.0, 59_999_999)
@example(2, -0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1)
def test_position_reports_of_ships(ais_class, lat, lon, cog, heading, sog, rot, utc_us):
    station = Station(257000001, ais_class, state.KIND_SHIP, "A", 100, 16)
    fields = position_report(station, lat, lon, cog=cog, heading=heading, sog=sog, rot=rot, utc_us=utc_us)
    (sentence,) = encode(fields)
    assert sentence.startswith("!AIVDM,1,1,,A,")
    assert len(sentence) <= 80
    assert checksum_is_right(sentence)
    got = pyais.decode(sentence)
    assert got.msg_type == (1 if ais_class == 1 else 18)
    assert got.mmsi == 257000001
    assert got.accuracy
    # pyais rounds to 1e-6 degrees after decoding
    assert got.lat == pytest.approx(lat, abs=0.5 / 600000 + 6e-7)
    assert got.lon == pytest.approx(lon, abs=0.5 / 600000 + 6e-7)
    assert got.speed * KNOT == pytest.approx(float(quantise_sog(sog)))
    assert abs(got.speed * KNOT - min(sog, 102.2 * KNOT)) <= 0.0501 * KNOT
    assert 0 <= got.course < 360
    assert got.course * DEG == pytest.approx(float(quantise_cog(cog)))
    assert abs(math.remainder(got.course * DEG - cog, 2 * math.pi)) <= 0.0501 * DEG
    assert 0 <= got.heading < 360
    assert abs(math.remainder(got.heading * DEG - heading, 2 * math.pi)) <= 0.501 * DEG
    assert got.heading * DEG == pytest.approx(float(quantise_heading(heading)))
    assert got.second == utc_us // 1_000_000 % 60
    if ais_class == 1:
        assert got.turn == pytest.approx(float(quantise_rot(rot)) / DEG_PER_MIN, abs=0.5)
        assert abs(got.turn) <= 709
        minutes = utc_us // 60_000_000
        assert got.radio == 1 << 14 | minutes // 60 % 24 << 9 | minutes % 60 << 2
    else:
        assert got.cs
        assert got.radio == 0b11100000000000000110


@given(st.text(max_size=40), st.floats(0, 2000), st.floats(0, 200), st.sampled_from([1, 2, 3]))
@example("Øystein Åsnes ÆGIR ß", 333.3, 64.0, 1)
@example("@@", 0.2, 0.1, 2)
@example("  a  " * 5, 100.0, 16.0, 3)
def test_static_messages(name, length, beam, ais_class):
    station = Station(257000002, ais_class, state.KIND_BOAT, name, length, beam)
    text = wire_text(name)
    if ais_class == 3:
        reports = [position_report(station, 59.4, 10.5, cog=0, heading=0, sog=0, rot=0, utc_us=0)]
    else:
        reports = static_reports(station)
    got = {}
    for report in reports:
        sentences = encode(report, sequence=13)
        assert all(checksum_is_right(sentence) and len(sentence) <= 80 for sentence in sentences)
        message = pyais.decode(*sentences)
        assert message.mmsi == 257000002
        got |= {key: value for key, value in message.asdict().items() if value is not None}
    assert got["msg_type"] == {1: 5, 2: 24, 3: 21}[ais_class]
    assert got["name" if ais_class == 3 else "shipname"] == text
    if ais_class < 3:
        assert got["ship_type"] == 37
    assert got["to_bow"] + got["to_stern"] == min(max(round(length), 1), 1022)
    assert got["to_port"] + got["to_starboard"] == min(max(round(beam), 1), 126)


def test_a_static_message_of_class_a_takes_two_sentences_that_belong_together():
    first, second = encode(static_reports(SHIP)[0], sequence=7)
    assert first.split(",")[1:4] == ["2", "1", "7"]
    assert second.split(",")[1:4] == ["2", "2", "7"]
    message = pyais.decode(first, second)
    assert message.shipname == "RESEARCH SHIP"
    assert (message.to_bow, message.to_stern, message.to_port, message.to_starboard) == (50, 50, 8, 8)
    assert message.ship_type == 70


def test_auxiliary_craft_have_a_mother_ship_in_place_of_dimensions():
    station = Station(982570001, state.AIS_CLASS_B, state.KIND_BOAT, "TENDER", 5, 2)
    part_b = pyais.decode(*encode(static_reports(station)[1]))
    assert part_b.mothership_mmsi == 0


def test_what_is_not_available():
    nothing = {"cog": math.nan, "heading": math.nan, "sog": math.nan, "rot": math.nan}
    got = pyais.decode(*encode(position_report(SHIP, math.nan, math.nan, **nothing, utc_us=0)))
    assert (got.lat, got.lon) == (91.0, 181.0)
    assert (got.speed, got.course, got.heading, int(got.turn)) == (102.3, 360.0, 511, -128)


def test_a_source_without_ais_cannot_report():
    station = Station(1, state.AIS_NONE, state.KIND_SHIP, "silent", 10, 2)
    with pytest.raises(ValueError, match="silent"):
        position_report(station, 0.0, 0.0, cog=0.0, heading=0.0, sog=0.0, rot=0.0, utc_us=0)
    assert static_reports(station) == []


def test_own_messages_are_vdo():
    fields = position_report(SHIP, 59.0, 10.0, cog=0.0, heading=0.0, sog=1.0, rot=0.0, utc_us=0)
    assert encode(fields, own=True, channel="B")[0].startswith("!AIVDO,1,1,,B,")


@pytest.mark.parametrize("code", range(-126, 127))
def test_every_rate_of_turn_code(code):
    """pyais takes +-127 and +-128 as codes and has no limit: neither must ever be reached from a rate."""
    rate = math.copysign((code / 4.733) ** 2, code) * DEG_PER_MIN
    fields = position_report(SHIP, 0.0, 0.0, cog=0.0, heading=0.0, sog=0.0, rot=rate, utc_us=0)
    payload = encode(fields)[0].split(",")[5]
    bits = "".join(f"{(c := ord(x) - 48) - 8 * (c > 40):06b}" for x in payload)
    assert int(bits[42:50], 2) == code % 256
    assert float(quantise_rot(rate)) == pytest.approx(rate, abs=1e-15)


@pytest.mark.parametrize("rate", [705 * DEG_PER_MIN, 720 * DEG_PER_MIN, 127 * DEG_PER_MIN, 128 * DEG_PER_MIN, 1e3])
def test_rates_at_which_pyais_would_trip(rate):
    for sign in (1, -1):
        fields = position_report(SHIP, 0.0, 0.0, cog=0.0, heading=0.0, sog=0.0, rot=sign * rate, utc_us=0)
        got = pyais.decode(*encode(fields)).turn
        assert got == pytest.approx(sign * min(rate / DEG_PER_MIN, 708.7), rel=0.05)


def test_every_tenth_survives_the_truncation_of_pyais():
    for tenth in range(1023):
        fields = {"msg_type": 1, "mmsi": 1, "speed": tenth / 10}
        assert pyais.decode(*encode(fields)).speed == tenth / 10
    for tenth in range(3601):
        assert pyais.decode(*encode({"msg_type": 1, "mmsi": 1, "course": tenth / 10})).course == tenth / 10


@given(st.floats(-50000, 50000), st.floats(-50000, 50000))
def test_quantised_positions_stay_when_sent(north, east):
    """What the kernel reports lies on the grid of the wire: sending it changes nothing."""
    n, e = quantise_position(north, east, ORIGIN, METRES)
    assert abs(n - north) <= 0.5 / 600000 * METRES[0] + 1e-8
    assert abs(e - east) <= 0.5 / 600000 * METRES[1] + 1e-8
    again = quantise_position(n, e, ORIGIN, METRES)
    assert again == pytest.approx((n, e), abs=1e-8)
    lat, lon = geodetic(n, e, ORIGIN, METRES)
    got = pyais.decode(*encode(position_report(SHIP, lat, lon, cog=0.0, heading=0.0, sog=0.0, rot=0.0, utc_us=0)))
    assert got.lat == pytest.approx(lat, abs=6e-7)
    assert got.lon == pytest.approx(lon, abs=6e-7)


def test_quantisation_keeps_nan_and_takes_arrays():
    for function in (quantise_sog, quantise_cog, quantise_heading, quantise_rot):
        values = function(np.array([0.1, np.nan, 0.2]))
        assert np.isnan(values).tolist() == [False, True, False]


def test_longitude_across_the_antimeridian():
    _, east = geodetic(0.0, [1000.0, -1000.0], (0.0, 180.0), (110574.0, 111320.0))
    assert east == pytest.approx([-180 + 1000 / 111320, 180 - 1000 / 111320])


def test_tag_blocks():
    (line,) = tag([THESIS[0]], 1_496_944_046_900_000)
    assert line.startswith("\\c:1496944046*")
    assert line.endswith(f"\\{THESIS[0]}")
    message = pyais.messages.NMEASentenceFactory.produce(line.encode())
    message.tag_block.init()
    assert message.tag_block.is_valid
    assert message.tag_block.receiver_timestamp == "1496944046"
    lines = tag(encode(static_reports(SHIP)[0]), 5_000_000, group=3)
    assert [line.split("\\")[1].split("*")[0] for line in lines] == ["g:1-2-3,c:5", "g:2-2-3,c:5"]
    assert all(checksum_is_right("!" + line.split("\\")[1]) for line in lines)
    # also where the sum is below 16, which pyais's own TagBlock writes with one digit
    assert all(len(tag([THESIS[0]], n * 1_000_000)[0].split("\\")[1].split("*")[1]) == 2 for n in range(200))
