/* SPDX-License-Identifier: MIT */
/* The rows of a table: a key with its type, unit, default, limits and member of a struct. Tables are constant.
 *
 * A row's path is generic: "stations[].lat_deg" stands for every station, and `item` is the station's number. Lists
 * of one table do not nest, so one number is enough. The copies of a mesh have a table of their own (copies.h). */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_ROW_H
#define FIRMWARE_SIM_CONFIG_TABLE_ROW_H

#include <stddef.h>
#include <stdint.h>

enum cfg_type {
    CFG_MAP,    /* a section, or one element of a list; nothing is stored */
    CFG_LIST,   /* offset, size: the array and its stride; count_offset: uint32_t; min..max elements. The next row is an
                * element: of type CFG_MAP, or of CFG_TEXT. */
    CFG_BOOL,   /* off|on -> int */
    CFG_ENUM,   /* names[value] -> int or enum; false and true are read as off and on here, too */
    CFG_COUNT,  /* whole number -> 4 or 8 bytes */
    CFG_MICRO,  /* decimal number, exact to 1e-6 -> int64_t in 1e-6 units */
    CFG_REAL,   /* double */
    CFG_TEXT,   /* char[size] */
    CFG_PATH,   /* char[size]; relative to the file that has it, or, in --set, to the working directory */
    CFG_VEC3,   /* [x, y, z] -> double[3] */
    CFG_PAIR,   /* [low, high] -> double[2] */
    CFG_POINTS, /* [[x, y], ...] -> struct config_points */
};

enum cfg_flags {
    CFG_FIGURE = 1,   /* written { value: V, from: data sheet|quoted|assumed }; source, note, definition may follow */
    CFG_HEX = 4,      /* written 0x1209, and only so: 1209 could be decimal or hexadecimal */
    CFG_ASCII = 2,    /* a name for clients, as in *IDN?: printable ASCII without comma, ';' and quotes */
    CFG_WRITTEN = 16, /* of CFG_PATH: the file is written; without this flag the file is read */
    CFG_NEEDED = 8,   /* has no default that suits most configurations: the example gives it a value */
    CFG_SPECIAL = 32, /* a list for some heads only: the example comments it out with all that is in it */
};

enum { CFG_MAX_ROWS = 320, CFG_MAX_ITEMS = 128, CFG_PATH_MAX = 96 };

struct cfg_key {
    const char *path;
    size_t offset, size; /* of the member */
    enum cfg_type type;
    const char *unit;              /* NULL: none */
    const char *def;               /* as written in YAML; NULL: required; "@KEY": the profile's figure KEY */
    double min, max;               /* in the unit, or number of elements */
    const char *min_key, *max_key; /* limits from the profile (crosscheck.c) */
    const char *allowed;           /* the allowed values, where min and max can't say them */
    const char *const *names;      /* enum: by value, NULL at the end */
    size_t count_offset;
    int flags;
    unsigned of;                    /* bits of the kinds of link, platform or emitter that have the key; 0: all kinds */
    unsigned of_backend;            /* for keys of USB links: bits of the back ends that have the key; 0: all */
    int needed;                     /* the kinds that have the key need it */
    const char *const *definitions; /* of a figure: the words of enum beam_definition */
    size_t definition_offset;
    const char *example; /* a value for the example, where there is no default */
    const char *help;
};

struct cfg_table {
    const struct cfg_key *keys;
    size_t n;
};
/* The kind, as a bit of a row's `of`. */
#define CFG_KIND(kind)           (1u << (kind))
#define CFG_LEN(array)           (sizeof(array) / sizeof((array)[0]))
#define CFG_MEMBER(type, member) offsetof(type, member), sizeof(((type *)0)->member)

const struct cfg_key *cfg_find(const struct cfg_table *table, const char *path);
/* Returns the list that a row belongs to; NULL for a row outside lists. */
const struct cfg_key *cfg_list_of(const struct cfg_table *table, const struct cfg_key *key);
/* "stations[].name", 2 -> "stations[2].name". buf holds CFG_PATH_MAX. */
const char *cfg_name(const char *path, uint32_t item, char *buf);
/* Cuts a path to the section around it: "links[].type" -> "links[]" -> "links" -> "". */
void cfg_cut_to_parent(char *path);
/* Returns whether path is the section, or a key in it. */
int cfg_is_in(const char *path, const char *section);
/* Returns the last word of path, if path is a key directly below parent ("": the top); else NULL. */
const char *cfg_word_below(const char *path, const char *parent);

/* Appends a word to the list "a, b, c" in buf, as far as it fits. */
void cfg_list_add(char *buf, size_t len, const char *word);
/* Writes the names of the kinds whose bits are set (CFG_KIND), "a, b". NULL ends the names. */
const char *cfg_list_kinds(unsigned kinds, const char *const *names, char *buf, size_t len);
/* Returns whether the list has the word. A list of NULL has none. */
int cfg_list_has(const char *list, const char *word);

/* Returns how many numbers a key of CFG_VEC3 or CFG_PAIR has. */
static inline int cfg_axes(const struct cfg_key *key)
{
    return key->type == CFG_PAIR ? 2 : 3;
}

#endif
