"""The plans of one device, each made once: which spans read a set of registers, and which take part in one exchange."""

from __future__ import annotations

from collections.abc import Iterable

from smadrive.devices.profile.profile import Profile
from smadrive.devices.read_plan import RegisterSpan, plan
from smadrive.errors import ConfigError

_Names = tuple[str, ...]


class Plans:
    """The plans for a device of `profile`, by the names of the registers."""

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._reads: dict[_Names, tuple[RegisterSpan, ...]] = {}
        self._exchanges: dict[tuple[_Names, _Names], tuple[RegisterSpan, RegisterSpan]] = {}

    def read(self, names: _Names) -> tuple[RegisterSpan, ...]:
        """What reads `names`."""
        spans = self._reads.get(names)
        if spans is None:
            spans = self._reads[names] = plan(self._profile, names)
        return spans

    def exchange(self, writes: _Names, reads: _Names) -> tuple[RegisterSpan, RegisterSpan]:
        """What one FC23 writes and reads; ConfigError when the registers do not lie side by side."""
        spans = self._exchanges.get((writes, reads))
        if spans is None:
            for name in writes:
                register = self._profile.register(name)
                if not (register.writable and register.exchangeable):
                    raise ConfigError(f"register '{name}' takes part in no exchange: write it by itself")
            spans = self._one(writes, "written"), self._one(reads, "read")
            self._exchanges[writes, reads] = spans
        return spans

    def _one(self, names: _Names, verb: str) -> RegisterSpan:
        spans = self.read(names)
        sizes = sum(part.register.size for part in spans[0].parts)
        torn = len(spans) != 1 or (verb == "written" and spans[0].count > sizes)
        if torn or spans[0].table != "holding":
            raise ConfigError(
                f"'{self._profile.profile.id}': {', '.join(names)} cannot be {verb} in one request: they must be "
                "adjacent holding registers"
            )
        return spans[0]


def words_of_register(spans: Iterable[RegisterSpan], words: Iterable[tuple[int, ...]], name: str) -> tuple[int, ...]:
    """The words of one register out of the words of the spans."""
    (found,) = (
        span_words[part.place]
        for span, span_words in zip(spans, words, strict=True)
        for part in span.parts
        if part.name == name
    )
    return found
