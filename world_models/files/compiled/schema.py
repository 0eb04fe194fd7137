"""The tables of a compiled world: one SQLite file, indexed by locale, by place (R*-tree) and by word.

Table ``extent`` holds the rectangles of locales in 32 bits, rounded outwards; ``bounds`` holds them exactly, with the
boxes round all that the locales contain. ``packet`` holds the geometry of locales, ``arc`` the edges of passage graphs;
``layer`` counts files of details.
"""

from __future__ import annotations

FORMAT = "harvey world 2"

SUFFIXES = (".world", ".sqlite")
"""Suffixes of compiled worlds."""

SCHEMA = """
create table meta (key text primary key, value text not null) without rowid;
create table locale (
    id integer primary key, name text not null unique, kind text not null, parent integer, frame blob not null,
    outline blob not null, height_m real not null, floor_m real not null, properties text not null,
    survey_m real not null, survey_rad real not null, source text not null, leaf integer not null);
create virtual table extent using rtree (id, x0, x1, y0, y1);
create table bounds (
    id integer primary key, x0 real not null, y0 real not null, x1 real not null, y1 real not null,
    reach blob not null);
create table doorway (
    id integer primary key, name text not null unique, a integer not null, b integer not null,
    thresholds blob not null, height_m real not null, source text not null);
create table link (
    id integer primary key, name text not null unique, kind text not null, a integer not null, b integer not null,
    stops blob not null, source text not null);
create table packet (
    id integer primary key, locale integer not null, neighbour integer, layer integer not null,
    words text not null, numbers blob not null);
create table thing (
    id integer primary key, locale integer not null, layer integer not null, name text not null, kind text not null,
    footprint blob not null, low_m real not null, high_m real not null, proud_m real, source text not null);
create table arc (
    id integer primary key, container integer not null, passage text not null,
    a integer not null, a_part integer not null, a_room integer not null,
    b integer not null, b_part integer not null, b_room integer not null);
create table component (
    locale integer not null, number integer not null, above integer not null,
    primary key (locale, number)) without rowid;
create table word (word text not null, locale integer not null, primary key (word, locale)) without rowid;
create table fault (source text not null, what text not null);
"""

INDICES = """
create index locale_parent on locale (parent);
create index doorway_a on doorway (a);
create index doorway_b on doorway (b);
create index link_a on link (a);
create index link_b on link (b);
create index packet_locale on packet (locale);
create index packet_neighbour on packet (neighbour) where neighbour is not null;
create index thing_locale on thing (locale);
create index arc_container on arc (container);
analyze;
"""
