/* SPDX-License-Identifier: MIT */
#include "drivers/record/ply_columns.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native.h"
#include "drivers/record/recorder.h"

enum {
    PAD_LINE = 64,       /* old readers take lines of 128 bytes or little more */
    NAME_ROOM = 160,     /* a label line of two names of 63 bytes, the longest a head sends */
    NAMES_MAX = 600,     /* any label line; a name has 255 bytes at most */
    COUNT_ROOM = 8 * 20, /* figures that may still grow to 20 digits */
    TIME_ROOM = 80,      /* the line of the GPS time, where it comes late */
    ORDER_ROOM = 120,    /* the line of frames that were not in order, where there are any */
    WEEK_S = 604800,
};

const char *ply_crs_text(const struct track *t)
{
    static const char *const text[] = {"scene frame, metres", "ECEF, metres",
                                       "UTM or UPS with ellipsoidal height, metres",
                                       "latitude and longitude in degrees, ellipsoidal height in metres"};
    static const char *const on_geoid[] = {"UTM or UPS with height above the geoid, metres",
                                           "latitude and longitude in degrees, height above the geoid in metres"};
    if (!t->begun) return "unknown, no points were recorded";
    return t->geoid_heights && t->crs >= 2 ? on_geoid[t->crs - 2] : text[t->crs];
}

/* Puts the names that fit into `room` bytes. Returns how many do not. */
static uint64_t put_names(FILE *out, const char *before, const struct scanhead *sh, size_t room)
{
    const char *object, *material;
    uint64_t n_left_out = 0;
    for (uint32_t label = 0; sh != NULL && label < SCANHEAD_NO_LABEL; label++) {
        char line[NAMES_MAX];
        if (!scanhead_surface(sh, label, &object, &material)) continue;
        snprintf(line, sizeof line, "label %u %s | %s", label, object, material);
        sh_keep_line(line);
        const size_t len = strlen(before) + strlen(line) + 1;
        if (len <= room)
            fprintf(out, "%s%s\n", before, line);
        else
            n_left_out++;
        room -= len <= room ? len : 0;
    }
    return n_left_out;
}

uint64_t ply_count_unnamed(const struct track *track)
{
    const char *object, *material;
    uint64_t n = 0;
    for (uint32_t label = 0; track->named != NULL && label < track->n_named && label < SCANHEAD_NO_LABEL; label++)
        n += (uint64_t)!scanhead_surface(track->named, label, &object, &material);
    return n;
}

void ply_put_names(FILE *out, const char *before, const struct scanhead *sh)
{
    put_names(out, before, sh, SIZE_MAX);
}

static void put_head(FILE *out, const struct ply_head *head, int several)
{
    char whose[32] = "";
    if (several) snprintf(whose, sizeof whose, "station %u ", head->station);
    fprintf(out, "comment %sidn %s\ncomment %sprofile %s\n", whose, head->idn, whose, head->profile);
}

void ply_put_colours(FILE *out, const char *before, const struct track *t)
{
    const struct colour_scale *scale = &t->colour.scale;
    fprintf(out, "%sred green blue ", before);
    if (!t->colour.given)
        fputs("as the head sent them (output.colour)\n", out);
    else if (colour_has_limits(scale->mode))
        fprintf(out, "show the %s, blue is %.9g, red %.9g%s\n", colour_words[scale->mode], scale->low, scale->high,
                scale->mode == COLOUR_FRAME ? "" : " m");
    else if (scale->mode == COLOUR_REFLECTANCE)
        fputs("show the reflectance, black is -30 dB, white 0 dB, blue not modelled\n", out);
    else
        fprintf(out, "%s\n", scale->mode == COLOUR_LABEL ? "show the label" : "are one colour for all");
}

/* Puts the counts of lost frames and pulses, which are known at the end. */
static void put_losses(FILE *out, const struct ply_facts *facts)
{
    const struct scanhead_stats *s = &facts->stats;
    fprintf(out,
            "comment frames_lost %" PRIu64 " reader_lost %" PRIu64 " dropped %" PRIu64 " bad_payload %" PRIu64 "\n",
            s->seq_lost, s->reader_lost, s->dropped, s->bad_payload);
    if (s->repeated + s->late + s->restarts != 0)
        fprintf(out, "comment frames_repeated %" PRIu64 " frames_late %" PRIu64 " restarts %" PRIu64 "\n", s->repeated,
                s->late, s->restarts);
    if (s->refused != 0) fprintf(out, "comment frames_refused %" PRIu64 "\n", s->refused);
    fprintf(out, "comment pulses_lost %" PRIu64 " points_before_descriptor %" PRIu64 "\n", s->pulses_lost,
            facts->n_unplaced);
}

static void put_comments(FILE *out, const struct ply_facts *facts)
{
    const struct track *t = facts->track;
    if (facts->incomplete) fputs(PLY_INCOMPLETE, out);
    fprintf(out, PLY_CRS "%s\n", ply_crs_text(t));
    fprintf(out, "comment epsg %d\n", t->epsg);
    for (uint32_t i = 0; i < facts->n_heads || i == 0; i++) /* a file without points has one head without names */
        put_head(out, &facts->head[i], facts->n_heads > 1);
    fprintf(out, "comment %s, time in seconds since the scan's start\n",
            t->begun && t->crs == NATIVE_CRS_GEODETIC ? "x latitude, y longitude in degrees, z range in metres"
                                                      : "x y z range in metres");
    if (facts->have_gps) {
        /* Rounded before it is split, so that no week ends with the second 604800.000000. */
        const double us = round(facts->gps_s * 1e6), week = floor(us / (WEEK_S * 1e6));
        fprintf(out, "comment the first scan starts at GPS week %.0f second %.6f\n", week,
                1e-6 * (us - week * (WEEK_S * 1e6)));
    }
    if ((facts->columns & PLY_REFLECTANCE) != 0) fputs("comment reflectance in dB, nan: not modelled\n", out);
    if ((facts->columns & PLY_ATTRIBUTES) != 0)
        fputs("comment amplitude in dB above the detection threshold, width of the echo in ns at half maximum\n", out);
    if ((facts->columns & PLY_ATTRIBUTES) != 0 && !facts->incomplete)
        fprintf(out, "comment points_without_attributes %" PRIu64 "\n", facts->n_without_attributes);
    if ((facts->columns & (PLY_ECHO | PLY_LABEL)) != 0)
        fputs("comment echo and echo_count 0: shot without echo; label 65535: none\n", out);
    if (t->moving)
        fputs("comment the head moved, each point has its own pose; frame: frame scalar of the trajectory, nan: lost\n",
              out);
    if (t->moving && !facts->incomplete)
        fprintf(out, "comment points_without_pose %" PRIu64 "\n", facts->n_without_pose);
    if (t->stops) fputs("comment the stations are stops on a trajectory; frame: its frame scalar there\n", out);
    if ((facts->columns & PLY_COLOUR) != 0) ply_put_colours(out, "comment ", t);
    fprintf(out, "comment empty_shots %s\n", facts->empty_shots ? "kept" : "left out");
    if (!facts->incomplete) put_losses(out, facts);
}

void ply_put_padding(FILE *out, size_t n)
{
    while (n > 0) {
        size_t line = n < 2 * PAD_LINE ? n : PAD_LINE; /* the last one takes the rest, so none is too short */
        fprintf(out, "comment%*s\n", (int)(line - PLY_PAD_MIN), "");
        n -= line;
    }
}

const char *const ply_column_words[] = {"range", "reflectance", "time",   "echo",  "label", "station",
                                        "frame", "attributes",  "colour", "float", "xyz",   NULL};

int ply_columns_read(const char *text, unsigned *columns)
{
    *columns = 0;
    for (;;) {
        const size_t n = strcspn(text, ",");
        unsigned i = 0;
        while (ply_column_words[i] != NULL &&
               (strlen(ply_column_words[i]) != n || strncmp(text, ply_column_words[i], n) != 0))
            i++;
        if (ply_column_words[i] == NULL || (*columns & 1U << i) != 0) return 0;
        *columns |= 1U << i;
        if (text[n] == '\0') return 1;
        text += n + 1;
    }
}

/* The columns in the order of the file. */
static const struct column {
    unsigned part; /* of enum ply_column; 0: always */
    const char *type, *name;
    int plain; /* known by that name everywhere */
} columns[] = {
    {0, "double", "x", 1},
    {0, "double", "y", 1},
    {0, "double", "z", 1},
    {PLY_RANGE, "double", "range", 0},
    {PLY_REFLECTANCE, "float", "reflectance", 0},
    {PLY_TIME, "double", "time", 0},
    {PLY_ECHO, "uchar", "echo", 0},
    {PLY_ECHO, "uchar", "echo_count", 0},
    {PLY_LABEL, "ushort", "label", 0},
    {PLY_STATION, "ushort", "station", 0},
    {PLY_FRAME, "double", "frame", 0},
    {PLY_ATTRIBUTES, "float", "amplitude", 0},
    {PLY_ATTRIBUTES, "float", "width", 0},
    {PLY_DEVIATION, "float", "deviation", 0},
    {PLY_COLOUR, "uchar", "red", 1},
    {PLY_COLOUR, "uchar", "green", 1},
    {PLY_COLOUR, "uchar", "blue", 1},
};

unsigned ply_columns_there(const struct track *track, unsigned asked)
{
    if (asked == 0) asked = PLY_ALL;
    if (!track->moving && !track->stops) asked &= ~(unsigned)PLY_FRAME;
    if (!track->has_attributes) asked &= ~(unsigned)PLY_ATTRIBUTES;
    if ((asked & PLY_ATTRIBUTES) != 0 && track->has_deviations) asked |= PLY_DEVIATION;
    if (!track->has_colours) asked &= ~(unsigned)PLY_COLOUR;
    return asked;
}

static int is_as_float(unsigned asked, const struct column *c)
{
    return (asked & PLY_FLOAT) != 0 && (c->part == 0 || c->part == PLY_RANGE);
}

size_t ply_row_len(unsigned asked)
{
    size_t len = 0;
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) {
        const struct column *c = &columns[i];
        if (c->part != 0 && (asked & c->part) == 0) continue;
        const char *type = is_as_float(asked, c) ? "float" : c->type;
        len += strcmp(type, "double") == 0 ? 8 : strcmp(type, "float") == 0 ? 4 : strcmp(type, "ushort") == 0 ? 2 : 1;
    }
    return len;
}

/* CloudCompare shows plain columns, and those called scalar_NAME. It shows others only where it is told to. */
static void put_column(FILE *out, const struct ply_facts *facts, const struct column *c)
{
    const char *type = is_as_float(facts->columns, c) ? "float" : c->type;
    fprintf(out, "property %s %s%s\n", type, facts->scalar_names && !c->plain ? "scalar_" : "", c->name);
}

/* How many bytes of names and of padding go into the header, and how many names do not. */
struct filling {
    size_t names, padding; /* bytes */
    uint64_t n_left_out;
};

static void put_header(FILE *out, const struct ply_facts *facts, struct filling *fill)
{
    const struct track *t = facts->track;
    fprintf(out, "ply\nformat %s 1.0\n", facts->ascii ? "ascii" : "binary_little_endian");
    put_comments(out, facts);
    fill->n_left_out = put_names(out, "comment ", t->named != NULL ? t->named : t->sh, fill->names);
    ply_put_padding(out, fill->padding);
    fprintf(out, "element vertex %" PRIu64 "\n", facts->n_vertices);
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++)
        if (columns[i].part == 0 || (facts->columns & columns[i].part) != 0) put_column(out, facts, &columns[i]);
    fputs("end_header\n", out);
}

static int make(const struct ply_facts *facts, struct filling *fill, char **text, size_t *len, struct sh_err *err)
{
    *text = NULL;
    FILE *out = open_memstream(text, len);
    if (out != NULL) put_header(out, facts, fill);
    if (out != NULL && fclose(out) == 0) return 0;
    free(*text);
    return sh_fail(err, SH_ENOMEM, "no memory for the header");
}

/* Leaves out heads until the header has room for the rest. Sets how many bytes are then left for names. */
static int fit(struct ply_facts *facts, size_t size, size_t *names, uint64_t *n_left_out, struct sh_err *err)
{
    char *text;
    size_t len;
    for (;; facts->n_heads--, ++*n_left_out) {
        const int rc = make(facts, &(struct filling){0}, &text, &len, err);
        if (rc != 0) return rc;
        free(text);
        if (len + PLY_PAD_MIN <= size) break;
        if (facts->n_heads <= 1) return sh_fail(err, SH_EFORMAT, "no room is left for the header");
    }
    *names = size - len - PLY_PAD_MIN;
    return 0;
}

int ply_header_make(const struct ply_facts *facts, size_t size, char **text, size_t *len, uint64_t *n_left_out,
                    struct sh_err *err)
{
    struct filling fill = {.names = SIZE_MAX};
    *n_left_out = 0;
    if (size == 0) return make(facts, &fill, text, len, err);
    struct ply_facts *some = malloc(sizeof *some);
    if (some == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the header");
    *some = *facts;
    int rc = fit(some, size, &fill.names, n_left_out, err);
    if (rc == 0) rc = make(some, &fill, text, len, err);
    if (rc == 0) {
        fill.padding = size - *len;
        free(*text);
        rc = make(some, &fill, text, len, err);
    }
    *n_left_out += fill.n_left_out;
    free(some);
    return rc;
}

/* With several heads, each line of a head has its station in front, also a line of the first head. */
static size_t heads_room(uint32_t more_heads)
{
    static const char station[] = "station 65535 ", lines[] = "comment idn \ncomment profile \n";
    enum { STATIONS = 2 * (sizeof station - 1), NAMES = sizeof(struct ply_head) - sizeof(uint32_t) };
    return more_heads == 0 ? 0 : STATIONS + more_heads * (STATIONS + sizeof lines + NAMES);
}

size_t ply_header_reserve(const struct ply_facts *facts, uint32_t n_surfaces)
{
    const char *object, *material;
    char *text;
    size_t len;
    uint64_t none;
    if (ply_header_make(facts, 0, &text, &len, &none, NULL) != 0) return 0;
    free(text);
    len += heads_room(facts->more_heads);
    if (facts->track->has_attributes) len += 20;
    for (uint32_t label = 0; label < n_surfaces; label++)
        if (!scanhead_surface(facts->track->sh, label, &object, &material)) len += NAME_ROOM;
    return len + COUNT_ROOM + TIME_ROOM + ORDER_ROOM + PLY_PAD_MIN;
}
