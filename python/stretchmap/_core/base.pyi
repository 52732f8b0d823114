from __future__ import annotations
import typing
__all__: list[str] = ['set_thread_count', 'thread_count']
def set_thread_count(count: typing.SupportsInt | typing.SupportsIndex) -> None:
    ...
def thread_count() -> int:
    ...
