"""HTML that is escaped unless it says otherwise: text from files can never become markup."""

from __future__ import annotations

from html import escape


class Html(str):
    """Text that is markup already; every other str is escaped where it enters a tag."""

    __slots__ = ()


def tag(name: str, *inside: str | None, **attributes: str | int | bool | None) -> Html:
    """<name attributes>inside</name>; `class_` is written class, `data_rule` data-rule.

    What is None or False is left out; an attribute that is True stands alone.
    """
    written = "".join(_attribute(key, value) for key, value in attributes.items())
    return Html(f"<{name}{written}>{join(*inside)}</{name}>")


def join(*parts: str | None) -> Html:
    """Parts in a row, escaped where they are not markup; None is nothing."""
    return Html("".join(part if isinstance(part, Html) else escape(part) for part in parts if part))


def _attribute(key: str, value: str | int | bool | None) -> str:
    name = key.rstrip("_").replace("_", "-")
    if value is None or value is False:
        return ""
    return f" {name}" if value is True else f' {name}="{escape(str(value))}"'
