/* SPDX-License-Identifier: MIT */
/* This turns the command line of build/bench into the options of a run. It prints its errors, one line each. */
#ifndef TESTS_BENCH_OPTIONS_H
#define TESTS_BENCH_OPTIONS_H

#include <stddef.h>

enum { BENCH_OK = 0, BENCH_FAILED = 1, BENCH_USAGE = 2 }; /* exit status */

#define BENCH_HOUSE_FILE "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc"

struct bench_options {
    const char *scenes; /* names with commas between; NULL: none */
    const char *house;  /* file of the IFC model; NULL: BENCH_HOUSE_FILE, and without it the house is left out */
    const char *out;    /* file for the JSON; NULL: standard output */
    double seconds;     /* for each scene */
    long threads;       /* of the run on all threads; 0: one per processor */
    const char *pulses; /* of the whole scans, with commas between; "none"; NULL: as README.md says */
    int whole;          /* all lines of the scans are cast */
    int only_sight;     /* only these scans are measured */
    int reach;          /* moving heads and bodies, and far stations, are measured, too */
    double leaks;       /* rays at edges and corners; 0: none */
};

/* Returns -1 to go on, else the exit status. */
int bench_parse(struct bench_options *o, int argc, char **argv);

/* Reads a number of pulses like 22.5M or 300k. Returns 0 if it is no number of 1,000 to 100M. */
double bench_pulses(const char *name);
/* Copies a file to standard error if it can be opened. */
void bench_show_file(const char *path);
/* Copies the next name of a list with commas into name. Returns the rest of the list, or NULL at the list's end. */
const char *bench_next_name(const char *list, char *name, size_t len);

#endif
