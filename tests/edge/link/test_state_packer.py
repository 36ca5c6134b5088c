"""The compiled packer gives the bytes that the wire's own gives."""

from math import inf, nextafter

import pytest
from hypothesis import given

from edge.link.sinks import packed
from hostlink.wire import State, pack_state, unpack_state
from hostlink.wire.fields import Field
from hostlink.wire.state import all_fields
from tests.support.states import MEASURED, any_state

pytestmark = pytest.mark.kernels


@given(any_state)
def test_any_sample_and_the_same_as_it_is_received(state: State) -> None:
    frame = pack_state(state, 300)
    assert packed(state, 300) == packed(unpack_state(frame), 300) == frame


@pytest.mark.parametrize("state", [State(), State(latency_us=3), State(contact_n=-1), State(sample=-1)])
def test_samples_of_few_fields(state: State) -> None:
    assert packed(state, 0) == pack_state(state, 0)


@pytest.mark.parametrize("f", MEASURED, ids=lambda f: f.name)
def test_values_at_and_beside_the_middle_of_two_steps_are_rounded_alike(f: Field) -> None:
    for n in range(f.raw_low, f.raw_high, 97):
        value = (n + 0.5) * f.scale
        for near in (nextafter(value, -inf), value, nextafter(value, inf)):
            state = State.of(all_fields({f.name: near}))
            assert packed(state, 0) == pack_state(state, 0), near
