/* SPDX-License-Identifier: MIT */
/* The header of a PLY recording: facts and names of surfaces go in, text comes out. The header stands at the beginning
 * of the file and is known at the end, so its size is reserved first. */
#ifndef DRIVERS_RECORD_PLY_COLUMNS_H
#define DRIVERS_RECORD_PLY_COLUMNS_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/record/track.h"

enum { PLY_MAX_HEADS = 128, PLY_PAD_MIN = 8 /* "comment\n" */ };
/* Lines of the header. PLY_CRS begins the first comment, or the second after PLY_INCOMPLETE; it shows that this program
 * wrote the file. PLY_INCOMPLETE stands there until the recording has its end. */
#define PLY_CRS        "comment crs "
#define PLY_INCOMPLETE "comment incomplete: its end is missing, and losses were not counted\n"

struct ply_facts {
    const struct track *track; /* its kind of points, and the handle that knows the surfaces' names */
    int ascii, empty_shots, scalar_names;
    unsigned columns;                /* enum ply_column: those that are asked for and exist */
    uint64_t n_vertices, n_unplaced; /* points before their descriptor and anchor were seen */
    uint64_t n_without_pose;         /* points of a moving head whose pose was lost */
    uint64_t n_without_attributes;   /* echoes */
    int incomplete;                  /* the recording goes on: its losses are not known */
    int have_gps;
    double gps_s; /* GPS time of the first scan's start */
    /* The head of the first scan, then each head that is not that of the scan before. */
    struct ply_head {
        uint32_t station;
        char idn[96], profile[32];
    } head[PLY_MAX_HEADS];
    uint32_t n_heads, more_heads; /* more_heads: room is left for so many more */
    struct scanhead_stats stats;
};

/* Returns those of the columns that points of the track have; other bits stay. To be called once the track has begun. */
unsigned ply_columns_there(const struct track *track, unsigned columns);
/* Returns the bytes of a binary row of these columns. */
size_t ply_row_len(unsigned columns);
/* Returns the meaning of the track's coordinates, in words. */
const char *ply_crs_text(const struct track *track);
/* Puts a line "label N OBJECT | MATERIAL", with `before` in front, for each surface that the stream has named. */
void ply_put_names(FILE *out, const char *before, const struct scanhead *sh);
/* Returns how many surfaces of the head have no name, because the stream ended before it had named all. */
uint64_t ply_count_unnamed(const struct track *track);
/* Puts a line with the meaning of the colours and their limits, with `before` in front. */
void ply_put_colours(FILE *out, const char *before, const struct track *track);

/* For recorder_report, with the count of ply_count_unnamed. */
#define PLY_UNNAMED \
    "surfaces have no name in the header: the stream ended before their names came; --surfaces of a CONFIG has all"

/* Returns the bytes to leave for the header: for all that is known now, and for names of n_surfaces not known yet. */
size_t ply_header_reserve(const struct ply_facts *facts, uint32_t n_surfaces);

/* Makes the header, padded by comment lines to exactly `size` bytes; 0: without padding. Names, and heads after the
 * first, that do not fit are left out; *n_left_out says how many. The caller frees *text. */
int ply_header_make(const struct ply_facts *facts, size_t size, char **text, size_t *len, uint64_t *n_left_out,
                    struct sh_err *err);
/* Puts lines of comment that take exactly n bytes; n is 0 or at least PLY_PAD_MIN. */
void ply_put_padding(FILE *out, size_t n);

#endif
