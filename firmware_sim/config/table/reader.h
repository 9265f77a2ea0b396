/* SPDX-License-Identifier: MIT */
/* The reader that fills a struct from YAML and --set by the rows of a table, and knows where each key was given. A
 * reader belongs to one thread. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_READER_H
#define FIRMWARE_SIM_CONFIG_TABLE_READER_H

#include <stdint.h>

#include "firmware_sim/config/table/row.h"

struct config_diagnostics;
struct config_profile;

enum { CFG_FROM_SET = -1 };

struct cfg_reader {
    const char *file;
    struct cfg_table table;
    void *base;                                     /* struct that the offsets count from */
    int line[CFG_MAX_ROWS][CFG_MAX_ITEMS];          /* where a key was given: line, CFG_FROM_SET, 0: not given */
    unsigned char bad[CFG_MAX_ROWS][CFG_MAX_ITEMS]; /* 1: this key has a diagnostic; its value means nothing */
    int root_line;
    int profile_read;                                /* 1: the head profile was read without a diagnostic */
    const struct config_profile *profile;            /* for the limits in errors; NULL: not known */
    unsigned char from[CFG_MAX_ROWS][CFG_MAX_ITEMS]; /* of a profile's figure: 1 + enum config_from; 0: not given */
    struct config_diagnostics *diagnostics;
    const char *of;  /* the text before its keys in errors; NULL: none */
    const char *set; /* the key of --set whose value is being parsed as YAML; NULL: none */
    /* The scanner of a station (forget.h): */
    int scanner;                      /* station, from 0, whose section `scanner` is used; -1: none */
    int in_scanner;                   /* that section is being read: paths begin there */
    unsigned char own[CFG_MAX_ROWS];  /* 1: the row was given there; its diagnostics say so */
    int scanner_since[CFG_MAX_ITEMS]; /* by station: how many --set come before the one that gave the section */
};

void cfg_reader_init(struct cfg_reader *rd, const char *file, const struct cfg_table *table, void *base,
                     struct config_diagnostics *diagnostics);
size_t cfg_row(const struct cfg_reader *rd, const struct cfg_key *key);
uint32_t *cfg_list_count(const struct cfg_reader *rd, const struct cfg_key *list);
void *cfg_address(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* Writes the name of a key (cfg_name), with "stations[1].scanner." before it where the row was given there. buf holds
 * 2 * CFG_PATH_MAX. */
const char *cfg_full_name(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item, char *buf);
/* Returns the line of a key, or of the nearest section around it that was given. */
int cfg_where(const struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* Fills in defaults for keys that were not given or are bad; reports required keys that are missing. profile may be
 * NULL. */
void cfg_fill_defaults(struct cfg_reader *rd, const struct config_profile *profile);

#endif
