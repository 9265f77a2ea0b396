/* SPDX-License-Identifier: MIT */
/* Private to this folder: the rows of the tables, and the reader that fills a struct from YAML and --set with
 * them.
 *
 * A row's path is generic: "stations[].lat_deg" stands for every station, and `item` is the station's number. Lists
 * do not nest, so one number is enough. Tables are constant; a reader belongs to one thread. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_H
#define FIRMWARE_SIM_CONFIG_TABLE_H

#include <stddef.h>
#include <stdint.h>

#include "firmware_sim/config/config.h"

enum cfg_type {
    CFG_MAP,   /* a section, or one element of a list; nothing is stored */
    CFG_LIST,  /* offset, size: the array and its stride; count_offset: uint32_t; min..max elements. The next row is an
                * element: of type CFG_MAP, or of CFG_TEXT. */
    CFG_BOOL,  /* off|on -> int */
    CFG_ENUM,  /* names[value] -> int or enum; false and true are read as off and on here, too */
    CFG_COUNT, /* whole number -> 4 or 8 bytes */
    CFG_MICRO, /* decimal number, exact to 1e-6 -> int64_t in 1e-6 units */
    CFG_REAL,  /* double */
    CFG_TEXT,  /* char[size] */
    CFG_PATH,  /* char[size]; relative to the file that has it, or, in --set, to the working directory */
    CFG_VEC3,  /* [x, y, z] -> double[3] */
    CFG_PAIR,  /* [low, high] -> double[2] */
};

enum cfg_flags {
    CFG_FIGURE = 1,   /* written { value: V, from: data sheet|quoted|assumed }; source, note, definition may follow */
    CFG_HEX = 4,      /* written 0x1209, and only so: 1209 could be decimal or hexadecimal */
    CFG_ASCII = 2,    /* goes into *IDN?: printable ASCII without comma and quotes */
    CFG_WRITTEN = 16, /* of CFG_PATH: the file is written; without it, it is read */
    CFG_NEEDED = 8,   /* has no default that suits most configurations: the example gives it a value */
};

enum { CFG_MAX_ROWS = 256, CFG_MAX_ITEMS = 128, CFG_PATH_MAX = 96, CFG_FROM_SET = -1 };

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
    const char *const *definitions; /* of a figure: the words of enum beam_definition */
    size_t definition_offset;
    const char *example; /* a value for the example, where there is no default */
    const char *help;
};

/* A figure of CFG_MICRO in its unit: the double nearest to the written number, so that errors and lists print that
 * number. */
static inline double from_micro(int64_t micro)
{
    return (double)micro / 1e6;
}

struct cfg_table {
    const struct cfg_key *keys;
    size_t n;
};
/* keys.c, profile_keys.c */
extern const struct cfg_table cfg_config_table, cfg_profile_table;
#define CFG_LEN(array)           (sizeof(array) / sizeof((array)[0]))
#define CFG_MEMBER(type, member) offsetof(type, member), sizeof(((type *)0)->member)

struct cfg_reader {
    const char *file;
    struct cfg_table table;
    void *base;                                     /* struct that the offsets count from */
    int line[CFG_MAX_ROWS][CFG_MAX_ITEMS];          /* where a key was given: line, CFG_FROM_SET, 0: not given */
    unsigned char bad[CFG_MAX_ROWS][CFG_MAX_ITEMS]; /* 1: this key has a diagnostic; its value means nothing */
    int root_line;
    int profile_read;                                /* the head profile has no diagnostic */
    const struct config_profile *profile;            /* for the limits in errors; NULL: not known */
    unsigned char from[CFG_MAX_ROWS][CFG_MAX_ITEMS]; /* of figures: 1 + enum config_from; 0: not given */
    struct config_faults *faults;
    const char *of;  /* the text before its keys in errors; NULL: none */
    const char *set; /* the key of --set whose value is being parsed as YAML; NULL: none */
    /* The scanner of a station (scanner.c): */
    int scanner;                      /* station, from 0, whose section `scanner` is used; -1: none */
    int in_scanner;                   /* that section is being read: paths begin there */
    unsigned char own[CFG_MAX_ROWS];  /* 1: the row was given there; its diagnostics say so */
    int scanner_since[CFG_MAX_ITEMS]; /* by station: how many --set come before the one that gave the section */
};

/* ---- reader.c: rows and places */
void cfg_reader_init(struct cfg_reader *rd, const char *file, const struct cfg_table *table, void *base,
                     struct config_faults *faults);
const struct cfg_key *cfg_find(const struct cfg_table *table, const char *path);
size_t cfg_row(const struct cfg_reader *rd, const struct cfg_key *key);
/* The list a row's elements belong to, NULL for a row outside lists. */
const struct cfg_key *cfg_list_of(const struct cfg_table *table, const struct cfg_key *key);
uint32_t *cfg_list_count(const struct cfg_reader *rd, const struct cfg_key *list);
void *cfg_address(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* The word of a key for its value. */
const char *cfg_word(const struct cfg_reader *rd, const char *path, int value);
/* "stations[].name", 2 -> "stations[2].name". buf holds CFG_PATH_MAX. */
const char *cfg_name(const char *path, uint32_t item, char *buf);
/* The same with "stations[1].scanner." before it where the row was given there. buf holds 2 * CFG_PATH_MAX. */
const char *cfg_full_name(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, char *buf);
int cfg_is_given(const struct cfg_reader *rd, const char *path, uint32_t item);
/* The line of a key, or of the nearest section around it that was given. */
int cfg_where(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* The section around a path, in place: "links[].type" -> "links[]" -> "links" -> "". */
void cfg_cut_to_parent(char *path);
/* The last word of path, when path is a key directly below parent ("": the top); NULL otherwise. */
const char *cfg_word_below(const char *path, const char *parent);

/* ---- fault.c: diagnostics. Each call adds one to the reader's list and returns its code, SH_EINPUT. Reading goes on
 * after it. */
/* "FILE:LINE: text", without the line when it is 0. Within a value of --set: "--set KEY: character LINE of the value:
 * text". Returns code. */
int cfg_fail_file(struct cfg_reader *rd, int code, int line, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* "FILE:LINE: KEY: text", or "--set KEY: text" when line is CFG_FROM_SET. */
int cfg_fail(struct cfg_reader *rd, int line, const char *name, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* The same for the value of a key, which is bad from now on. */
int cfg_fail_value(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, const char *fmt, ...)
    __attribute__((format(printf, 5, 6)));
/* The same at the key's own line, or at the section's where the key is missing. Nothing is added where the key, or a
 * section around it, has a diagnostic already: this one may only follow from that one. */
int cfg_fail_key(struct cfg_reader *rd, const char *path, uint32_t item, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* An unknown key below the section parent ("" for the top): suggests a similar key and lists the known ones. The
 * similar key is marked bad, so that it is not reported as missing, too. */
int cfg_fail_unknown(struct cfg_reader *rd, int line, const char *parent, uint32_t item, const char *word);
/* Whether all of these keys (of sections: all keys in them) were read without a diagnostic, so that a check can use
 * their values. */
int cfg_are_sound(const struct cfg_reader *rd, uint32_t item, const char *const *paths, size_t n);
#define CFG_SOUND(rd, item, ...)                                    \
    cfg_are_sound((rd), (item), (const char *const[]){__VA_ARGS__}, \
                  sizeof((const char *const[]){__VA_ARGS__}) / sizeof(const char *))
/* text made fit for one line of an error: cut, without control characters. buf holds CFG_SHOW_MAX. */
enum { CFG_SHOW_MAX = 64 };
const char *cfg_show(const char *text, char *buf);

/* ---- value.c: texts to values */
enum cfg_number { CFG_NUMBER_OK, CFG_NOT_A_NUMBER, CFG_TOO_FINE, CFG_TOO_LARGE };
/* Exact: text * 10^decimals as a whole number. Grammar: [+-] digits [. digits] [e [+-] digits], no leading
 * zeros, which YAML 1.1 reads as octal. */
enum cfg_number cfg_parse_decimal(const char *text, int decimals, __int128 *out);
/* Stores one scalar; base_dir (with its '/', may be empty) is put before relative paths. */
int cfg_store(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, const char *text,
              const char *base_dir);
/* How many numbers a key of CFG_VEC3 or CFG_PAIR has. */
static inline int cfg_axes(const struct cfg_key *key)
{
    return key->type == CFG_PAIR ? 2 : 3;
}
int cfg_store_vec3(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, int line, int axis,
                   const char *text);
/* The values that a row takes: "allowed 1 to 5 Hz". profile gives the limits that depend on it; NULL: those of all
 * profiles. */
enum { CFG_ALLOWED_MAX = 480 }; /* room for the longest list of words, the kinds of faults */
const char *cfg_allowed(const struct cfg_key *key, const struct config_profile *profile, char *buf);
/* Directory part of a path, with its '/'; empty for a bare name. buf holds CONFIG_PATH_LEN. */
const char *cfg_dir_of(const char *path, char *buf);

/* ---- yaml.c, set.c, config.c, profile.c, crosscheck.c. Diagnostics of values go to the reader's list. */
/* SH_OK, or the code of a diagnostic that leaves nothing to check: no file, no YAML, no section. */
int cfg_read_file(struct cfg_reader *rd);
/* The same; the document stays open for the scanner. NULL after an error. */
struct cfg_document;
int cfg_open_file(struct cfg_reader *rd, struct cfg_document **doc);
/* The same from a text in memory. */
int cfg_open_text(struct cfg_reader *rd, const unsigned char *bytes, size_t len, struct cfg_document **doc);
void cfg_close_file(struct cfg_document *doc);
/* Reads the section `scanner` of rd->scanner over the values that were read before. */
void cfg_read_scanner(struct cfg_reader *rd, struct cfg_document *doc);
/* Applies the sets of the file's own keys, or, with in_scanner, those of the scanner. The others are skipped. doc: the
 * file's document, which keeps values that are YAML. */
void cfg_apply_sets(struct cfg_reader *rd, struct cfg_document *doc, const char *const *sets, int n_sets);
/* Reads a list or a section from YAML in a --set. The key must have been forgotten before (cfg_forget). */
void cfg_read_set_value(struct cfg_reader *rd, struct cfg_document *doc, const struct cfg_key *key, uint32_t item,
                        const char *text);
/* scanner.c: whether a scanner may have the section, or the key in it. */
int cfg_is_of_scanner(const char *path);
extern const char cfg_sections_of_scanner[];
/* The key is about to be read in a scanner: the file's value of it is dropped. */
void cfg_take_over(struct cfg_reader *rd, const struct cfg_key *key);
/* The scanner is read completely. With a profile of its own it does not inherit the file's head. */
void cfg_end_scanner(struct cfg_reader *rd);
/* Resets a list as if it had not been given. */
void cfg_forget_list(struct cfg_reader *rd, const char *path);
/* The same for a list, a section, or an element of a list. */
void cfg_forget(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* Loads for the scanner of a station, from 1; 0: of head.station. Diagnostics are added to those in the list. */
int cfg_load_for(const char *path, const char *const *sets, int n_sets, uint32_t station, struct config *cfg,
                 struct config_faults *faults);
/* Loads the scanners of the other stations, adds their diagnostics, and notes in cfg which station has which. */
void cfg_check_scanners(struct config *cfg, struct config_faults *faults);
/* Adds a diagnostic in the order of its place. */
int cfg_add_fault(struct config_faults *faults, uint64_t place, int code, const char *text);
/* A key that is not given and has no default. */
void cfg_fail_missing(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* Fills in defaults for keys that were not given or are bad; reports required keys that are missing. profile may be
 * NULL. */
void cfg_fill_defaults(struct cfg_reader *rd, const struct config_profile *profile);
/* Where a file that comes with the program ("heads", "scenes/x.obj") may be, for i from 0: beside an
 * installed program, beside one in its build folder, in config/ of the working directory. buf holds CONFIG_PATH_LEN.
 * 0: there is no i-th place. */
int cfg_shared_path(int i, const char *name, char *buf);
/* The first of these places that has it; 0: none. */
int cfg_find_shared(const char *name, char *buf);
/* The file of a scenario: a path (with a slash, or an ending), or the name of one that comes with the program. buf
 * holds CONFIG_PATH_LEN. 0: there is none of that name. */
int cfg_find_scenario(const char *name, char *buf);
/* A figure of a profile that is written in 1e-6 units. */
int64_t cfg_figure(const struct config_profile *profile, const char *path);
double cfg_real_figure(const struct config_profile *profile, const char *path);
/* Finds and reads the profile that head.profile names (cfg->profile_file holds the name, then the path). */
void cfg_load_profile(struct cfg_reader *rd, struct config *cfg);
/* Checks everything that concerns more than one key, as far as these keys were read well. */
void cfg_check(struct cfg_reader *rd, struct config *cfg);
/* copies.c: lists of copies of a mesh: the rows of a copy; a reader for the next copy, below the key `name`; the checks
 * once all are read. */
extern const struct cfg_table cfg_copy_table;
void cfg_begin_copy(struct cfg_reader *rd, const struct cfg_reader *of, uint32_t mesh, const char *name, int line);
/* Removes copies: all of them (scene, scene.meshes), or those of one mesh. */
void cfg_forget_copies(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
void cfg_check_copies(struct cfg_reader *rd, const struct config *cfg);
/* places.c: checks the anchor, and the forms of a station's place. */
void cfg_check_places(struct cfg_reader *rd, struct config *cfg);
/* tripod.c: checks the tripods of stations. */
void cfg_check_tripods(struct cfg_reader *rd, struct config *cfg);
/* measurement.c: checks noise, signal, surfaces, and the keys of a profile that concern them. */
void cfg_check_signal(struct cfg_reader *rd, struct config *cfg);
void cfg_check_reaches(struct cfg_reader *rd, struct config_profile *profile);
/* programs.c: converts widths of the beam to this project's definition; completes the programs of a profile; checks
 * that head.prr_hz is the rate of one. */
void cfg_convert_widths(struct cfg_reader *rd, struct config_profile *profile);
void cfg_check_programs(struct cfg_reader *rd, struct config_profile *profile);
void cfg_check_rate(struct cfg_reader *rd, const struct config *cfg);
/* The share of a sweep that the field of view takes. */
double cfg_used_share(const struct config_profile *profile);
/* profile_list.c: prints one profile for config_list_profiles. */
void cfg_list_profile(const struct cfg_reader *rd, const struct config_profile *profile, FILE *out);
/* The words of enum config_from. */
extern const char *const cfg_from_names[];
/* emitter.c: checks which keys of a profile belong to its emitter, and derives values from them. */
void cfg_check_emitter(struct cfg_reader *rd, struct config_profile *profile);
/* Whether profiles of some emitters need the key; then `words` gets the names of these emitters. */
int cfg_needed_by_emitter(const struct cfg_key *key, char *words, size_t len);
/* Whether a line spans an angle: from start up to stop, of a sphere also across azimuth 0. */
int cfg_line_has_width(const struct config *cfg);
/* range.c: checks head.range_min_m and range_max_m, and limits the profile in cfg and its programs to them. */
void cfg_limit_range(struct cfg_reader *rd, struct config *cfg);
/* Copies ranges, noise and step into the scan's settings, which commands may change. After all checks. */
void cfg_take_scan_settings(struct config *cfg);
/* Checks the geometries of a planar head's profile; chooses the one that the configuration asks for. */
void cfg_check_geometries(struct cfg_reader *rd, struct config_profile *profile);
void cfg_choose_geometry(struct cfg_reader *rd, struct config *cfg);
/* The settings of a head whose pulse rate follows from its lines. */
void cfg_check_emitter_settings(struct cfg_reader *rd, struct config *cfg);
/* crosscheck.c: checks the loop. */
void cfg_check_loop(struct cfg_reader *rd, const struct config *cfg);
/* owned.c: keys that only some kinds of link have, and what a link needs. */
void cfg_check_links(struct cfg_reader *rd, struct config *cfg);
/* usb_look.c: fills in the USB identity of a usb link from its protocol; and ids and serial number if not given. */
void cfg_set_usb_serial(struct cfg_reader *rd, const struct config *cfg, struct link_spec *link, uint32_t item);
void cfg_set_usb_look(struct cfg_reader *rd, struct link_spec *link, uint32_t item);
/* The same for keys of platforms. Returns whether all of them belong to this kind. */
int cfg_check_platform_keys(struct cfg_reader *rd, const struct config_platform *platform);
/* platform.c: the platform's keys with each other. Sets seconds from frames. */
void cfg_check_platform(struct cfg_reader *rd, struct config *cfg);
/* faults.c: checks injected faults against each other; and against the links of cfg. */
void cfg_check_faults(struct cfg_reader *rd, struct fault_list *list);
void cfg_check_fault_links(struct cfg_reader *rd, const struct config *cfg, const struct fault_list *list);
/* fault_beam.c: checks the faults against the head, its noise and its signal. */
void cfg_check_fault_beams(struct cfg_reader *rd, const struct config *cfg, const struct fault_list *list);
/* link_protocol.c: checks what the protocols of links need. */
void cfg_check_link_protocols(struct cfg_reader *rd, struct config *cfg);
/* Whether the protocol can describe a head of this emitter. */
int cfg_protocol_fits(const struct protocol_ops *ops, const struct emitter *emitter);
/* The first link whose protocol has this need; -1: none. */
int cfg_link_that_needs(const struct config *cfg, enum protocol_needs need);

#endif
