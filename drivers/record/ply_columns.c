#include "drivers/record/ply_columns.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    PAD_LINE = 64,       /* old readers take lines of 128 bytes or little more */
    PAD_MIN = 8,         /* "comment\n" */
    NAME_ROOM = 160,     /* a label line of two names of 63 bytes, the longest a head sends */
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

int ply_names_grow(struct ply_names *names, uint32_t n, struct sh_err *err)
{
    if (n <= names->n) return 0;
    struct ply_name *more = realloc(names->name, n * sizeof *more);
    if (more == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u surface names", n);
    memset(more + names->n, 0, (n - names->n) * sizeof *more);
    names->name = more;
    names->n = n;
    return 0;
}

int ply_names_set(struct ply_names *names, uint32_t label, const char *object, const char *material, struct sh_err *err)
{
    char *line;
    int rc = ply_names_grow(names, label + 1, err);
    if (rc != 0) return rc;
    if (asprintf(&line, "comment label %u %s | %s", label, object, material) < 0)
        return sh_fail(err, SH_ENOMEM, "no memory for surface names");
    printable(line);
    if (names->name[label].line == NULL) names->n_named++;
    free(names->name[label].line);
    names->name[label].line = line;
    return 0;
}

void ply_names_free(struct ply_names *names)
{
    for (uint32_t i = 0; i < names->n; i++)
        free(names->name[i].line);
    free(names->name);
    memset(names, 0, sizeof *names);
}

static const char *crs_text(const struct ply_facts *facts)
{
    static const char *const text[] = {"scene frame, metres", "ECEF, metres",
                                       "UTM or UPS with ellipsoidal height, metres",
                                       "latitude and longitude in degrees, ellipsoidal height in metres"};
    static const char *const on_geoid[] = {"UTM or UPS with height above the geoid, metres",
                                           "latitude and longitude in degrees, height above the geoid in metres"};
    if (!facts->have_crs) return "unknown, no points were recorded";
    return facts->geoid_heights && facts->crs >= 2 ? on_geoid[facts->crs - 2] : text[facts->crs];
}

static void put_comments(FILE *out, const struct ply_facts *facts, const struct ply_names *names)
{
    char idn[sizeof facts->idn], profile[sizeof facts->profile];
    memcpy(idn, facts->idn, sizeof idn);
    memcpy(profile, facts->profile, sizeof profile);
    printable(idn);
    printable(profile);
    const struct scanhead_stats *s = &facts->stats;
    fprintf(out, "comment crs %s\n", crs_text(facts));
    fprintf(out, "comment epsg %d\n", facts->epsg);
    fprintf(out, "comment idn %s\n", idn);
    fprintf(out, "comment profile %s\n", profile);
    fprintf(out, "comment %s, time in seconds since the scan's start\n",
            facts->have_crs && facts->crs == 3 ? "x latitude, y longitude in degrees, z range in metres"
                                               : "x y z range in metres");
    if (facts->have_gps) {
        double week = floor(facts->gps_s / WEEK_S);
        fprintf(out, "comment the first scan starts at GPS week %.0f second %.6f\n", week,
                facts->gps_s - week * WEEK_S);
    }
    fputs("comment reflectance in dB, nan: not modelled\n", out);
    if (facts->attributes)
        fprintf(out,
                "comment amplitude in dB above the detection threshold, width of the echo in ns at half maximum\n"
                "comment points_without_attributes %" PRIu64 "\n",
                facts->n_without_attributes);
    fputs("comment echo and echo_count 0: shot without echo; label 65535: none\n", out);
    if (facts->moving)
        fprintf(
            out,
            "comment the head moved, each point has its own pose; frame: frame scalar of the trajectory, nan: lost\n"
            "comment points_without_pose %" PRIu64 "\n",
            facts->n_without_pose);
    if (facts->stops) fputs("comment the stations are stops on a trajectory; frame: its frame scalar there\n", out);
    fprintf(out, "comment empty_shots %s\n", facts->empty_shots ? "kept" : "left out");
    fprintf(out,
            "comment frames_lost %" PRIu64 " reader_lost %" PRIu64 " dropped %" PRIu64 " bad_payload %" PRIu64 "\n",
            s->seq_lost, s->reader_lost, s->dropped, s->bad_payload);
    fprintf(out, "comment pulses_lost %" PRIu64 " points_before_descriptor %" PRIu64 "\n", s->pulses_lost,
            facts->n_unplaced);
    for (uint32_t i = 0; i < names->n; i++)
        if (names->name[i].line != NULL) fprintf(out, "%s\n", names->name[i].line);
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

static void put_header(FILE *out, const struct ply_facts *facts, const struct ply_names *names, size_t padding)
{
    fprintf(out, "ply\nformat %s 1.0\n", facts->ascii ? "ascii" : "binary_little_endian");
    put_comments(out, facts, names);
    put_padding(out, padding);
    fprintf(out, "element vertex %" PRIu64 "\n", facts->n_vertices);
    fputs("property double x\nproperty double y\nproperty double z\nproperty double range\n"
          "property float reflectance\nproperty double time\nproperty uchar echo\nproperty uchar echo_count\n"
          "property ushort label\nproperty ushort station\n",
          out);
    if (facts->moving || facts->stops) fputs("property double frame\n", out);
    if (facts->attributes) fputs("property float amplitude\nproperty float width\n", out);
    fputs("end_header\n", out);
}

int ply_header_make(const struct ply_facts *facts, const struct ply_names *names, size_t size, char **text, size_t *len,
                    struct sh_err *err)
{
    size_t padding = 0;
    for (int pass = 0; pass < 2; pass++) {
        *text = NULL;
        FILE *out = open_memstream(text, len);
        if (out != NULL) put_header(out, facts, names, padding);
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

size_t ply_header_reserve(const struct ply_facts *facts, const struct ply_names *names)
{
    char *text;
    size_t len;
    if (ply_header_make(facts, names, 0, &text, &len, NULL) != 0) return 0;
    free(text);
    if (facts->attributes) len += 20;
    return len + COUNT_ROOM + TIME_ROOM + PAD_MIN + (size_t)(names->n - names->n_named) * NAME_ROOM;
}
