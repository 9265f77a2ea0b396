/* SPDX-License-Identifier: MIT */
/* Finds each point of a client among those that the head had, and how often it came.
 *
 * A point of the client's may agree with several of the head's. These points of the head's are then one group, and
 * counts are compared by group. Each point of the client's agrees with the head's point that it comes from, so both are
 * in the same group. Where the client has no point more often than it was sent, no group has more points than were
 * sent. Dense points therefore give no false finding. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/mat3.h"
#include "core/vec3.h"
#include "firmware_sim/app/studio/verdict/match.h"
#include "firmware_sim/app/studio/verdict/match_index.h"

enum { TRIED_POINTS = 2000, MAX_WAYS = 3, LOOK_POINTS = 64 };

/* ---- coordinate frames */

/* A transformation from a coordinate frame that the client may use to the stream's. */
struct way {
    const char *frame;
    int is_forward;        /* x forward, y left first becomes x right, y forward */
    double turn[9], at[3]; /* then this rotation, row by row, and this place */
};

static void match_go(const struct way *way, const double from[3], double to[3])
{
    const double p[3] = {way->is_forward ? -from[1] : from[0], way->is_forward ? from[0] : from[1], from[2]};
    mat3_apply(way->turn, p, to);
    vec3_add(to, way->at, to);
}

static struct way *add_way(struct way ways[MAX_WAYS], int *n, const char *frame, int is_forward)
{
    struct way *way = &ways[(*n)++];
    *way = (struct way){.frame = frame, .is_forward = is_forward};
    memcpy(way->turn, mat3_unit, sizeof way->turn);
    return way;
}

/* Lists the coordinate frames to try, the stream's own first. For a head that stands still, without a CRS, they are the
 * scene, the head, and the head with x forward. */
static int find_ways(const struct own_stream *stream, struct way ways[MAX_WAYS])
{
    const struct scanhead_info *info = &stream->info;
    const int stands = !info->moving && !stream->is_moved;
    int n = 0;
    if (info->geo || info->moving) {
        const int is_scene = !info->geo || info->crs == 0;
        add_way(ways, &n, is_scene ? "scene" : "the stream's CRS", 0);
        for (int forward = 0; forward < 2 && is_scene && stands; forward++) {
            struct way *way = add_way(ways, &n, forward ? "head, x forward" : "head", forward);
            memcpy(way->turn, info->rotation, sizeof way->turn);
            memcpy(way->at, info->station_m, sizeof way->at);
        }
        return n;
    }
    add_way(ways, &n, "head", 0);
    add_way(ways, &n, "head, x forward", 1);
    if (!stands) return n;
    struct way *way = add_way(ways, &n, "scene", 0); /* the inverse of head to scene */
    mat3_transpose(info->rotation, way->turn);
    mat3_apply(way->turn, info->station_m, way->at);
    for (int k = 0; k < 3; k++)
        way->at[k] = -way->at[k];
    return n;
}

static int is_empty(const double p[3])
{
    return isnan(p[0]) || (fabs(p[0]) + fabs(p[1]) + fabs(p[2]) <= 0.0);
}

/* Tries the transformations on a sample of points from the whole cloud. Returns the one with most points that agree. */
static const struct way *best_way(const struct match_index *index, const struct match_input *in, const struct way *ways,
                                  int n_ways)
{
    const struct cloud *cloud = in->cloud;
    const size_t step = cloud->n / TRIED_POINTS + 1;
    const struct way *best = ways;
    size_t most = 0;
    for (int k = 0; k < n_ways; k++) {
        size_t n = 0;
        for (size_t i = 0; i < cloud->n && !sh_stopped(in->report); i += step) {
            double p[3];
            if (is_empty(cloud->xyz_m[i])) continue;
            match_go(&ways[k], cloud->xyz_m[i], p);
            n += match_index_near(index, p, NULL, NULL) != 0;
        }
        if (n <= most) continue;
        most = n;
        best = &ways[k];
    }
    return best;
}

/* ---- what was sent */

static int compare_spoiled(const void *left, const void *right)
{
    const struct watch_spoiled *a = left, *b = right;
    if (a->session != b->session) return a->session < b->session ? -1 : 1;
    return a->seq != b->seq ? (a->seq < b->seq ? -1 : 1) : 0;
}

/* Counts the sessions to which the frame was sent. A session's time is taken two ticks longer at both ends, since
 * frames there may have been sent or not. */
static uint32_t count_sent(const struct watch *watch, int64_t tick_ns, const struct own_frame *frame)
{
    uint32_t n = 0;
    for (size_t i = 0; i < watch->n_span; i++) {
        const struct watch_span *span = &watch->span[i];
        const struct watch_spoiled key = {span->session, frame->seq};
        if (frame->t_ns < span->from_ns - 2 * tick_ns || frame->t_ns / 2 > span->to_ns / 2 + tick_ns) continue;
        n += watch->n_spoiled == 0 ||
             bsearch(&key, watch->spoiled, watch->n_spoiled, sizeof key, compare_spoiled) == NULL;
    }
    return n;
}

static int index_stream(const struct match_input *in, struct match_index *index, struct sh_err *err)
{
    const struct own_stream *stream = in->stream;
    struct watch *watch = in->watch;
    size_t n = 0;
    index->entry = malloc((stream->n > 0 ? stream->n : 1) * sizeof *index->entry);
    if (index->entry == NULL) return sh_fail(err, SH_ENOMEM, "no memory to compare %zu points", stream->n);
    if (watch->n_spoiled != 0) qsort(watch->spoiled, watch->n_spoiled, sizeof *watch->spoiled, compare_spoiled);
    for (size_t f = 0; f < stream->n_frames; f++) {
        const uint32_t sent = count_sent(watch, in->tick_ns, &stream->frame[f]);
        for (; n < stream->frame[f].end; n++) {
            memcpy(index->entry[n].p, stream->xyz_m[n], sizeof index->entry[n].p);
            index->entry[n].sent = sent;
        }
    }
    index->n = n;
    match_index_make(index);
    return SH_OK;
}

/* ---- counting */

struct taker {
    struct match_index *index;
    size_t first; /* of the entries that the point at hand agrees with; SIZE_MAX: none so far */
};

static void match_take(void *ctx, size_t entry)
{
    struct taker *taker = ctx;
    if (taker->first == SIZE_MAX)
        taker->first = entry;
    else
        match_index_join(taker->index, taker->first, entry);
}

static void count_groups(const struct match_index *index, struct verdict_points *m)
{
    for (size_t i = 0; i < index->n; i++) {
        const struct match_entry *e = &index->entry[i];
        if (e->parent != i) continue;
        m->sent += e->sent;
        m->again += e->sent > 0 ? e->sent - 1 : 0;
        if (e->got > e->sent) m->repeated += e->got - e->sent;
    }
}

/* With a large distance each point agrees with very many others, and takes long. So the loop often asks whether to
 * stop. */
static int count_points(struct match_index *index, const struct match_input *in, const struct way *way,
                        struct verdict_points *m, struct sh_err *err)
{
    const struct cloud *cloud = in->cloud;
    int rc = SH_OK;
    for (size_t i = 0; i < cloud->n && rc == SH_OK; i++) {
        struct taker taker = {index, SIZE_MAX};
        double p[3];
        if (i % LOOK_POINTS == 0) rc = sh_check_stop(in->report, err);
        if (is_empty(cloud->xyz_m[i])) {
            m->empty++;
            continue;
        }
        m->n++;
        match_go(way, cloud->xyz_m[i], p);
        match_index_near(index, p, match_take, &taker);
        if (taker.first != SIZE_MAX)
            index->entry[match_index_root(index, taker.first)].got++;
        else if (m->unknown++ == 0)
            m->first_unknown = i;
    }
    count_groups(index, m);
    return rc;
}

/* ---- how far coordinates may differ */

/* No point of the head has a coordinate beyond this one, in any of the frames: a rotation keeps lengths. */
static double limit_of(const struct own_stream *stream)
{
    double largest = 0.0;
    for (size_t i = 0; i < stream->n; i++)
        largest = fmax(largest, vec3_length(stream->xyz_m[i]));
    return largest + vec3_length(stream->info.station_m);
}

static int is_within(const double p[3], double limit_m)
{
    return fabs(p[0]) <= limit_m && fabs(p[1]) <= limit_m && fabs(p[2]) <= limit_m;
}

static double largest_m(const struct cloud *cloud, double limit_m)
{
    double largest = 0.0;
    for (size_t i = 0; i < cloud->n; i++)
        for (int k = 0; k < 3 && is_within(cloud->xyz_m[i], limit_m); k++)
            largest = fmax(largest, fabs(cloud->xyz_m[i][k]));
    return largest;
}

double match_unit_m(const struct cloud *cloud, double limit_m)
{
    const size_t step = cloud->n / TRIED_POINTS + 1;
    int decimals = 0, digits = 1;
    const double largest = cloud->is_text || cloud->is_single ? largest_m(cloud, limit_m) : 0.0;
    if (!cloud->is_text) return cloud->is_single ? cloud_single_unit(largest) : cloud->count_m;
    for (size_t i = 0; i < cloud->n; i += step)
        for (int k = 0; k < 3 && is_within(cloud->xyz_m[i], limit_m); k++) {
            char text[32];
            /* A double keeps 15 digits of a decimal number. Zeros at their end do not count: D.DDDD0000e-02. */
            snprintf(text, sizeof text, "%.14e", fabs(cloud->xyz_m[i][k]));
            char *mark = strchr(text, 'e'), *end = mark;
            while (end[-1] == '0')
                end--;
            const int n = (int)(end - text) - 1, exponent = atoi(mark + 1);
            if (n > digits) digits = n;
            if (n - 1 - exponent > decimals) decimals = n - 1 - exponent;
        }
    /* A file writes all coordinates with the same number of decimals, or of digits. */
    const int exponent = largest > 0.0 ? (int)floor(log10(largest)) : 0;
    const int last = decimals < digits - 1 - exponent ? decimals : digits - 1 - exponent;
    return pow(10.0, -last);
}

/* Two programs that compute the same coordinate in double precision, by rotation and sum, differ by some units in the
 * last place of the largest one. At least a nanometre is allowed, since no link resolves less. */
static double rounding_m(double limit_m)
{
    return fmax(4.0 * DBL_EPSILON * limit_m, 1e-9);
}

int match_points(const struct match_input *in, struct verdict_points *match, struct sh_err *err)
{
    const double limit_m = limit_of(in->stream);
    struct match_index index = {0};
    struct way ways[MAX_WAYS];
    *match = (struct verdict_points){.unit_m = match_unit_m(in->cloud, limit_m)};
    match->within_m = index.within_m = fmax(match->unit_m + in->match_m, rounding_m(limit_m));
    int rc = index_stream(in, &index, err);
    if (rc == SH_OK) {
        const struct way *way = best_way(&index, in, ways, find_ways(in->stream, ways));
        match->frame = way->frame;
        rc = count_points(&index, in, way, match, err);
    }
    free(index.entry);
    return rc;
}
