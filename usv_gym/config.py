"""Configuration machinery: YAML in, frozen models out, and errors that say where and why.  No domain knowledge.

A file becomes a :class:`Document` (plain data that remembers the line of every key), overrides are written into it, and
:func:`validate` turns it into a :class:`Model`.  What is wrong is raised as :class:`ConfigError`, a line per problem::

    busy.yaml:14: ships.research_ship.length: expected a number greater than 0, got -100
"""

from __future__ import annotations

import copy
import difflib
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from .resources import shipped

KeyPath = tuple[str | int, ...]


class ConfigError(ValueError):
    """A configuration that cannot be used; one line per problem: ``file:line: key.path: expected ..., got ...``."""


# --- models ----------------------------------------------------------------------------------------------------------
class Model(BaseModel):
    """Base of all schemas: frozen, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _only_known_keys(cls, data: Any) -> Any:
        # before the fields are looked at: a misspelt required key is one problem, not "unknown" plus "missing"
        if isinstance(data, Mapping):
            known = cls.keys()
            if unknown := [key for key in data if key not in known]:
                raise PydanticCustomError("unknown_key", "unknown key", {"keys": unknown, "known": known})
        return data

    @classmethod
    def keys(cls) -> list[str]:
        """Keys of the mapping, as written in YAML."""
        return [info.alias or name for name, info in cls.model_fields.items()]

    def dump(self) -> dict[str, Any]:
        """Plain data (mappings, lists, numbers, text) that validates to an equal model, defaults written out."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)

    def to_yaml(self) -> str:
        """YAML text that loads to an equal model."""
        return dump_yaml(self.dump())


ModelT = TypeVar("ModelT", bound=Model)


def problem(message: str, *key: str | int) -> PydanticCustomError:
    """What a validator raises to say ``message`` about ``key`` (below the value that it validates)."""
    return PydanticCustomError("problem", "{message}", {"key": key, "message": message})


def suggestion(word: object, known: Iterable[str]) -> str:
    """``; did you mean 'x'?``, or the list of what there is when nothing looks alike."""
    names = list(known)
    by_lower = {name.lower(): name for name in names}
    close = difflib.get_close_matches(str(word).lower(), by_lower, n=1)
    if close:
        return f"; did you mean {by_lower[close[0]]!r}?"
    return f"; expected one of: {', '.join(names)}" if names else ""


def json_schema(model: type[Model]) -> dict[str, Any]:
    """JSON Schema (2020-12) of what may be written in a file of this model, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}


def dump_yaml(data: Mapping[str, Any]) -> str:
    """YAML text of plain data, in its order, that :func:`parse_yaml` reads back as it was."""
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)


# --- documents -------------------------------------------------------------------------------------------------------
@dataclass
class Document:
    """Plain data and where it came from."""

    name: str  #: file or other name, first word of every error
    data: dict[str, Any]
    origins: dict[KeyPath, str] = field(default_factory=dict)  #: ``file:line`` or the override, by key path
    directory: Path | None = None  #: of the file, where relative paths in it begin

    def where(self, path: KeyPath) -> str:
        """``file:line: a.b.c``; an override is named instead of a line that it replaced."""
        origin = next((self.origins[path[:n]] for n in range(len(path), -1, -1) if path[:n] in self.origins), self.name)
        return ": ".join([origin, ".".join(map(str, path))]) if path else origin

    def replaced(self, path: KeyPath, value: Any, origin: str) -> Document:
        """A copy with the value at a key path replaced; missing mappings on the way are made.

        Raises
        ------
        ConfigError
            if the path runs through something that has no keys, or past the end of a list.
        """
        data = copy.deepcopy(self.data)
        node: Any = data
        for depth, key in enumerate(path):
            last = depth == len(path) - 1
            if isinstance(node, list):
                if not (str(key).isdecimal() and int(key) < len(node)):
                    raise ConfigError(f"{origin}: {_dotted(path[:depth])} is a list of {len(node)}: no item {key!r}")
                key = int(key)
                path = (*path[:depth], key, *path[depth + 1 :])
            elif isinstance(node, dict):
                if not last and node.get(key) is None:
                    node[key] = {}
            else:
                raise ConfigError(f"{origin}: {_dotted(path[:depth])} is {_show(node)}: it has no key {key!r}")
            if last:
                node[key] = value
            else:
                node = node[key]
        origins = {known: where for known, where in self.origins.items() if known[: len(path)] != path}
        return Document(self.name, data, {**origins, path: origin}, self.directory)

    def override(self, overrides: Sequence[str]) -> Document:
        """A copy with ``a.b.c=value`` applied in order; values are read as YAML, list items are numbered from 0.

        Raises
        ------
        ConfigError
            if an override has no ``=``, an empty key, a value that is not YAML, or a path that leads nowhere.
        """
        if isinstance(overrides, str):
            raise ConfigError(f"overrides: expected a list of texts like 'a.b=1', got the text {overrides!r}")
        document = self
        for text in overrides:
            origin = f"override {text!r}"
            dotted, equals, value = text.partition("=")
            keys = [part.strip() for part in dotted.split(".")]
            if not equals or not all(keys):
                raise ConfigError(f"{origin}: expected key.path=value")
            document = document.replaced(tuple(keys), _parse(value, origin)[0], origin)
        return document


def read_yaml(path: str | Path) -> Document:
    """Read one YAML file.

    YAML 1.2 scalars: ``off`` and ``no`` are texts, ``1e-6`` is a number, ``12:30`` is a text.

    Raises
    ------
    ConfigError
        if the file is missing, empty, not UTF-8, not YAML, not a mapping, or has a key twice.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        near = [str(other) for other in sorted(file.parent.glob("*.y*ml"))] if file.parent.is_dir() else []
        close = difflib.get_close_matches(str(file), near, n=1)
        raise ConfigError(f"{file}: no such file" + (f"; did you mean {close[0]!r}?" if close else "")) from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: expected UTF-8 text: {error.reason} at byte {error.start}") from None
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from None
    return parse_yaml(text, str(file), file.parent)


def parse_yaml(text: str, name: str, directory: Path | None = None) -> Document:
    """Like :func:`read_yaml`, for text that is at hand already."""
    data, lines = _parse(text, name)
    if data is None:
        raise ConfigError(f"{name}: is empty; expected a mapping of keys")
    if not isinstance(data, dict):
        raise ConfigError(f"{name}: expected a mapping of keys, got {_show(data)}")
    return Document(name, data, {path: f"{name}:{line}" for path, line in lines.items()}, directory)


def locate(kind: str, name: str, directory: Path | None = None, *, what: str = "") -> Path:
    """File of a configuration: a name that ships in ``configs/<kind>``, or a path, first looked for in ``directory``.

    ``what`` is what the error calls it; default: ``kind`` without its plural s.

    Raises
    ------
    ConfigError
        if there is no such name or file; the message lists what ships or the likely meant name.
    """
    names = shipped(kind)
    if name in names:
        return names[name]
    what = what or kind.removesuffix("s")
    if Path(name).suffix in (".yaml", ".yml"):
        for path in ([directory / name] if directory else []) + [Path(name)]:
            if path.is_file():
                return path
        raise ConfigError(f"{what} file {name!r}: no such file")
    raise ConfigError(f"unknown {what} {name!r}{suggestion(name, names)}")


def validate(model: type[ModelT], document: Document) -> ModelT:
    """Turn plain data into a frozen model.

    Validators find the document's directory in ``info.context["directory"]``.

    Raises
    ------
    ConfigError
        one line for each problem, with file, line, full key path, what was expected and what came.
    """
    try:
        return model.model_validate(document.data, context={"directory": document.directory})
    except ValidationError as error:
        raise ConfigError("\n".join(dict.fromkeys(_problems(error, document)))) from None


# --- errors ----------------------------------------------------------------------------------------------------------
_EXPECTED = {
    "missing": "required key is missing",
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "bool_type": "expected true or false",
    "string_type": "expected text",
    "model_type": "expected a mapping of keys",
    "model_attributes_type": "expected a mapping of keys",
    "dict_type": "expected a mapping of keys",
    "tuple_type": "expected a list",
    "list_type": "expected a list",
    "finite_number": "expected a finite number",
    "greater_than": "expected a number greater than {gt:.12g}",
    "greater_than_equal": "expected a number of at least {ge:.12g}",
    "less_than": "expected a number less than {lt:.12g}",
    "less_than_equal": "expected a number of at most {le:.12g}",
    "too_long": "expected at most {max_length} items",
    "too_short": "expected at least {min_length} items",
    "literal_error": "expected {expected}",
}


def _problems(error: ValidationError, document: Document) -> Iterator[str]:
    for detail in error.errors(include_url=False):
        kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
        if kind == "default_factory_not_called":  # a consequence of another error
            continue
        path = _keys_only(detail["loc"], document.data, missing=kind == "missing")
        if kind == "unknown_key":
            for key in context["keys"]:
                yield f"{document.where((*path, key))}: unknown key{suggestion(key, context['known'])}"
        elif kind == "problem":
            yield f"{document.where(path + context['key'])}: {context['message']}"
        elif kind == "value_error":
            yield f"{document.where(path)}: {context['error']}"
        elif kind == "missing":
            yield f"{document.where(path)}: {_EXPECTED[kind]}"
        else:
            message = _EXPECTED[kind].format(**context) if kind in _EXPECTED else detail["msg"]
            more = suggestion(value, re.findall(r"'([^']*)'", context["expected"])) if kind == "literal_error" else ""
            got = f"{len(value)} items" if kind in ("too_long", "too_short") else _show(value)
            yield f"{document.where(path)}: {message}, got {got}{more if more.startswith('; did') else ''}"


def _keys_only(location: Sequence[str | int], data: Any, missing: bool) -> KeyPath:
    """The parts of pydantic's location that are keys of the data (others are names of union branches)."""
    path: list[str | int] = []
    node = data
    for depth, part in enumerate(location):
        if isinstance(node, Mapping):
            if part in node:
                path.append(part)
                node = node[part]
            elif missing and depth == len(location) - 1:
                path.append(part)
        elif isinstance(node, list | tuple) and isinstance(part, int):
            path.append(part)
            node = node[part] if part < len(node) else None
    return tuple(path)


def _show(value: Any) -> str:
    if value is None:
        return "nothing (null)"
    if isinstance(value, Mapping):
        return f"a mapping of {', '.join(map(str, value)) or 'no keys'}"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _dotted(path: KeyPath) -> str:
    return ".".join(map(str, path))


# --- YAML ------------------------------------------------------------------------------------------------------------
class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  (PyYAML's way)


class _Dumper(yaml.SafeDumper):
    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012

    def ignore_aliases(self, data: Any) -> bool:  # each thing written where it is used
        return True

    def represent_str(self, data: str) -> yaml.ScalarNode:
        # PyYAML writes some control characters as they are, and reads them back as line breaks
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=None if data.isprintable() else '"')


_Dumper.add_representer(str, _Dumper.represent_str)

# The core schema of YAML 1.2.  PyYAML's own tables are those of 1.1, where `off` is false and `1e-6` is a text.
for _cls in (_Loader, _Dumper):
    for _tag, _pattern, _first in (
        ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
        ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
        ("int", r"[-+]?(0|[1-9][0-9]*)", list("-+0123456789")),
        ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
         list("-+.0123456789")),
        ("merge", r"<<", ["<"]),
    ):  # fmt: skip
        _cls.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def _parse(text: str, name: str) -> tuple[Any, dict[KeyPath, int]]:
    """Data, and the line of every key path."""
    lines: dict[KeyPath, int] = {}
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None, lines
        _walk(loader, node, (), lines, set(), name)
        return loader.construct_document(node), lines
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        raise ConfigError(f"{name}{line}: not valid YAML: {error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{name}: not valid YAML: {str(error).splitlines()[0]}") from None


def _walk(
    loader: _Loader, node: yaml.Node, path: KeyPath, lines: dict[KeyPath, int], above: set[int], name: str
) -> None:
    """Note the line of every key and refuse a key that is there twice (PyYAML would take the last one)."""
    if id(node) in above:
        raise ConfigError(f"{name}:{node.start_mark.line + 1}: {_dotted(path)}: an alias that contains itself")
    above = above | {id(node)}
    if isinstance(node, yaml.SequenceNode):
        for i, item in enumerate(node.value):
            lines[(*path, i)] = item.start_mark.line + 1
            _walk(loader, item, (*path, i), lines, above, name)
    elif isinstance(node, yaml.MappingNode):
        first: dict[Hashable, int] = {}
        for key_node, value in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise ConfigError(f"{name}:{line}: {_dotted(path) or 'top level'}: expected a plain key")
            key = key_node.value if key_node.value == "<<" else loader.construct_object(key_node)
            if key in first:
                raise ConfigError(f"{name}:{line}: {_dotted((*path, key))}: duplicate key, first on line {first[key]}")
            first[key] = line
            lines[(*path, key)] = line
            _walk(loader, value, (*path, key), lines, above, name)
