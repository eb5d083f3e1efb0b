"""A drive through any matcher, whether it knows the route or score rows alone."""

from __future__ import annotations

from evplace.matchers import Answer, Following, Matcher, Matching, Route, RouteMatcher, Row, Seen


class _OnRowsAlone:
    """A Following that shows its matcher the score rows alone."""

    def __init__(self, matching: Matching) -> None:
        self._matching = matching

    def step(self, row: Row, seen: Seen) -> list[Answer]:  # noqa: ARG002 - see Following
        """See Following."""
        answer = self._matching.step(row)
        return [] if answer is None else [answer]

    def finish(self) -> list[Answer]:
        """See Following."""
        return []


def follow(matcher: Matcher, route: Route, distances: bool) -> Following:
    """Begin a traverse."""
    if isinstance(matcher, RouteMatcher):
        return matcher.follow(route, distances)
    return _OnRowsAlone(matcher.start(distances))
