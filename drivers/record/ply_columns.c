#include "drivers/record/ply_columns.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native.h"

enum {
    PAD_LINE = 64,       /* old readers take lines of 128 bytes or little more */
    PAD_MIN = 8,         /* "comment\n" */
    NAME_ROOM = 160,     /* a label line of two names of 63 bytes, the longest a head sends */
    NAMES_MAX = 600,     /* any label line; a name has 255 bytes at most */
    COUNT_ROOM = 8 * 20, /* figures that may still grow to 20 digits */
    TIME_ROOM = 80,      /* the line of the GPS time, where it comes late */
    WEEK_S = 604800,
};

/* A name must not end its line. */
static void printable(char *text)
{
    for (; *text != 0; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f) *text = '?';
}

static const char *crs_text(const struct ply_facts *facts)
{
    static const char *const text[] = {"scene frame, metres", "ECEF, metres",
                                       "UTM or UPS with ellipsoidal height, metres",
                                       "latitude and longitude in degrees, ellipsoidal height in metres"};
    static const char *const on_geoid[] = {"UTM or UPS with height above the geoid, metres",
                                           "latitude and longitude in degrees, height above the geoid in metres"};
    const struct track *t = facts->track;
    if (!t->begun) return "unknown, no points were recorded";
    return t->geoid_heights && t->crs >= 2 ? on_geoid[t->crs - 2] : text[t->crs];
}

/* Of all surfaces that the stream has named so far. */
static void put_names(FILE *out, const struct scanhead *sh)
{
    const char *object, *material;
    for (uint32_t label = 0; sh != NULL && label < SCANHEAD_NO_LABEL; label++) {
        char line[NAMES_MAX];
        if (!scanhead_surface(sh, label, &object, &material)) continue;
        snprintf(line, sizeof line, "comment label %u %s | %s", label, object, material);
        printable(line);
        fprintf(out, "%s\n", line);
    }
}

static void put_comments(FILE *out, const struct ply_facts *facts)
{
    const struct track *t = facts->track;
    char idn[sizeof facts->idn], profile[sizeof facts->profile];
    memcpy(idn, facts->idn, sizeof idn);
    memcpy(profile, facts->profile, sizeof profile);
    printable(idn);
    printable(profile);
    const struct scanhead_stats *s = &facts->stats;
    fprintf(out, "comment crs %s\n", crs_text(facts));
    fprintf(out, "comment epsg %d\n", t->epsg);
    fprintf(out, "comment idn %s\n", idn);
    fprintf(out, "comment profile %s\n", profile);
    fprintf(out, "comment %s, time in seconds since the scan's start\n",
            t->begun && t->crs == NATIVE_CRS_GEODETIC ? "x latitude, y longitude in degrees, z range in metres"
                                                      : "x y z range in metres");
    if (facts->have_gps) {
        double week = floor(facts->gps_s / WEEK_S);
        fprintf(out, "comment the first scan starts at GPS week %.0f second %.6f\n", week,
                facts->gps_s - week * WEEK_S);
    }
    fputs("comment reflectance in dB, nan: not modelled\n", out);
    if (t->has_attributes)
        fprintf(out,
                "comment amplitude in dB above the detection threshold, width of the echo in ns at half maximum\n"
                "comment points_without_attributes %" PRIu64 "\n",
                facts->n_without_attributes);
    fputs("comment echo and echo_count 0: shot without echo; label 65535: none\n", out);
    if (t->moving)
        fprintf(
            out,
            "comment the head moved, each point has its own pose; frame: frame scalar of the trajectory, nan: lost\n"
            "comment points_without_pose %" PRIu64 "\n",
            facts->n_without_pose);
    if (t->stops) fputs("comment the stations are stops on a trajectory; frame: its frame scalar there\n", out);
    if (facts->colour != COLOUR_NONE)
        fprintf(out, "comment red green blue show the %s\n",
                facts->colour == COLOUR_LABEL ? "label"
                                              : "reflectance, black is -30 dB, white 0 dB, blue not modelled");
    fprintf(out, "comment empty_shots %s\n", facts->empty_shots ? "kept" : "left out");
    fprintf(out,
            "comment frames_lost %" PRIu64 " reader_lost %" PRIu64 " dropped %" PRIu64 " bad_payload %" PRIu64 "\n",
            s->seq_lost, s->reader_lost, s->dropped, s->bad_payload);
    fprintf(out, "comment pulses_lost %" PRIu64 " points_before_descriptor %" PRIu64 "\n", s->pulses_lost,
            facts->n_unplaced);
    put_names(out, t->sh);
}

/* Lines of comment that take exactly n bytes; n is 0 or at least PAD_MIN. */
static void put_padding(FILE *out, size_t n)
{
    while (n > 0) {
        size_t line = n < 2 * PAD_LINE ? n : PAD_LINE; /* the last one takes the rest, so none is too short */
        fprintf(out, "comment%*s\n", (int)(line - PAD_MIN), "");
        n -= line;
    }
}

/* CloudCompare shows columns of other names than these only where it is told to. */
static void put_column(FILE *out, const struct ply_facts *facts, const char *type, const char *name)
{
    fprintf(out, "property %s %s%s\n", type, facts->scalar_names ? "scalar_" : "", name);
}

static void put_header(FILE *out, const struct ply_facts *facts, size_t padding)
{
    fprintf(out, "ply\nformat %s 1.0\n", facts->ascii ? "ascii" : "binary_little_endian");
    put_comments(out, facts);
    put_padding(out, padding);
    fprintf(out, "element vertex %" PRIu64 "\n", facts->n_vertices);
    for (int i = 0; i < 3; i++)
        fprintf(out, "property double %c\n", "xyz"[i]);
    static const char *const always[][2] = {{"double", "range"},  {"float", "reflectance"}, {"double", "time"},
                                            {"uchar", "echo"},    {"uchar", "echo_count"},  {"ushort", "label"},
                                            {"ushort", "station"}};
    for (size_t i = 0; i < sizeof always / sizeof always[0]; i++)
        put_column(out, facts, always[i][0], always[i][1]);
    if (facts->track->moving || facts->track->stops) put_column(out, facts, "double", "frame");
    if (facts->track->has_attributes) {
        put_column(out, facts, "float", "amplitude");
        put_column(out, facts, "float", "width");
    }
    if (facts->colour != COLOUR_NONE) fputs("property uchar red\nproperty uchar green\nproperty uchar blue\n", out);
    fputs("end_header\n", out);
}

int ply_header_make(const struct ply_facts *facts, size_t size, char **text, size_t *len, struct sh_err *err)
{
    size_t padding = 0;
    for (int pass = 0; pass < 2; pass++) {
        *text = NULL;
        FILE *out = open_memstream(text, len);
        if (out != NULL) put_header(out, facts, padding);
        if (out == NULL || fclose(out) != 0) {
            free(*text);
            return sh_fail(err, SH_ENOMEM, "no memory for the header");
        }
        if (pass == 1 || *len >= size) break;
        padding = size - *len;
        if (padding < PAD_MIN) padding += PAD_MIN;
        free(*text);
    }
    return 0;
}

size_t ply_header_reserve(const struct ply_facts *facts, uint32_t n_surfaces)
{
    const char *object, *material;
    char *text;
    size_t len;
    if (ply_header_make(facts, 0, &text, &len, NULL) != 0) return 0;
    free(text);
    if (facts->track->has_attributes) len += 20;
    for (uint32_t label = 0; label < n_surfaces; label++)
        if (!scanhead_surface(facts->track->sh, label, &object, &material)) len += NAME_ROOM;
    return len + COUNT_ROOM + TIME_ROOM + PAD_MIN;
}
