/* SPDX-License-Identifier: MIT */
/* This measures libscanhead's decoder: points of a frame as structs and as columns, in each layout.
 *
 *   build/tests/bench/decode [--rounds N] [--raw]
 *
 * A frame of 3,274 points lies in the cache, and is decoded 256 points at a time, as recorders do. All cases come in
 * turns. Figures are processor time of the thread; --raw prints those of each round in place of medians. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/bvh.h"
#include "drivers/host/scanhead.h"
#include "tests/bench/bench.h"
#include "tests/bench/made_stream.h"
#include "tests/bench/options.h"
#include "tests/bench/pin.h"

enum { TIMES = 300, MAX_ROUNDS = 99, LAYOUTS = 3, WAYS = 3 };

static const char *const LAYOUT[LAYOUTS] = {"polar", "utm", "geodetic"};
static const char *const WAY[WAYS] = {"points", "columns", "recorded"};

struct reader {
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct scanhead_columns columns[WAYS]; /* [0]: none; those of a recorder lack range and angles */
};

static struct scanhead_point points[MADE_BATCH];

static int open_reader(enum made_layout layout, struct reader *r)
{
    struct made_stream stream;
    char source[32], err[256] = "no memory";
    int rc = made_stream_create(layout, 1, &stream);
    if (rc == 0) rc = made_stream_source(&stream, source, sizeof source);
    free(stream.bytes);
    if (rc == 0) rc = scanhead_open(source, &r->sh, err, sizeof err);
    if (rc == 0) {
        do
            rc = scanhead_next(r->sh, &r->frame, 0);
        while (rc == 0 && r->frame.type != SCANHEAD_POINTS);
    }
    if (rc != 0) fprintf(stderr, "decode: %s\n", r->sh != NULL ? scanhead_error(r->sh) : err);
    r->columns[1] = r->columns[2] = made_columns;
    r->columns[2].range_m = r->columns[2].mirror_rad = r->columns[2].pan_rad = NULL;
    return rc;
}

static double decode_ns(struct reader *r, int way)
{
    const double start_s = bench_thread_s();
    for (int i = 0; i < TIMES; i++)
        for (uint32_t first = 0; first < r->frame.n_points; first += MADE_BATCH) {
            if (way == 0)
                scanhead_points(r->sh, &r->frame, first, points, MADE_BATCH);
            else
                scanhead_columns(r->sh, &r->frame, first, &r->columns[way], MADE_BATCH);
        }
    return 1e9 * (bench_thread_s() - start_s) / TIMES / r->frame.n_points;
}

static double ns[LAYOUTS][WAYS][MAX_ROUNDS];

static void print(uint32_t rounds, int raw)
{
    for (uint32_t i = 0; raw && i < rounds; i++)
        for (int layout = 0; layout < LAYOUTS; layout++)
            for (int way = 0; way < WAYS; way++)
                printf("%s:%s_ns %.3f\n", WAY[way], LAYOUT[layout], ns[layout][way][i]);
    if (raw) return;
    char engine[128];
    bvh_engine(engine, sizeof engine, NULL);
    printf("%s\n%-10s %9s %9s %9s   ns a point; recorded: columns without range and angles\n", engine, "", WAY[0],
           WAY[1], WAY[2]);
    for (int layout = 0; layout < LAYOUTS; layout++)
        printf("%-10s %9.2f %9.2f %9.2f\n", LAYOUT[layout], bench_median(ns[layout][0], rounds),
               bench_median(ns[layout][1], rounds), bench_median(ns[layout][2], rounds));
}

int main(int argc, char **argv)
{
    static const struct option table[] = {
        {"rounds", required_argument, NULL, 'r'}, {"raw", no_argument, NULL, 'w'}, {NULL, 0, NULL, 0}};
    static struct reader reader[LAYOUTS];
    uint32_t rounds = 15;
    int raw = 0, bad = 0;
    for (int c; (c = getopt_long(argc, argv, "", table, NULL)) >= 0;) {
        if (c == 'r') rounds = (uint32_t)strtoul(optarg, NULL, 10);
        raw |= c == 'w';
        bad |= c == '?';
    }
    if (bad || optind != argc || rounds < 1 || rounds > MAX_ROUNDS) {
        fprintf(stderr, "decode [--rounds N] [--raw]: allowed is N from 1 to %d\n", MAX_ROUNDS);
        return BENCH_USAGE;
    }
    pin(NULL);
    for (int layout = 0; layout < LAYOUTS; layout++)
        if (open_reader((enum made_layout)layout, &reader[layout]) != 0) return BENCH_FAILED;
    for (uint32_t i = 0; i < rounds; i++)
        for (int layout = 0; layout < LAYOUTS; layout++)
            for (int way = 0; way < WAYS; way++)
                ns[layout][way][i] = decode_ns(&reader[layout], way);
    print(rounds, raw);
    for (int layout = 0; layout < LAYOUTS; layout++)
        scanhead_close(reader[layout].sh);
    return BENCH_OK;
}
