/* SPDX-License-Identifier: MIT */
/* This is the pipeline once more, line by line, with the cycle counter read between its stages. */
#include <stdlib.h>

#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native_encode.h"
#include "tests/bench/bench.h"
#include "firmware_sim/base/clock.h"

struct bench_stages {
    struct caster *caster;
    struct bvh_profile profile;
};

/* This says which stage of the bench a stage of the caster belongs to. */
static const enum bench_stage STAGE_OF[CAST_STAGES] = {
    [CAST_DIRECTIONS] = STAGE_DIRECTIONS, [CAST_EMBREE] = STAGE_EMBREE, [CAST_REFINE] = STAGE_REFINE,
    [CAST_DETECT] = STAGE_DETECT,         [CAST_NOISE] = STAGE_NOISE,   [CAST_POSITIONS] = STAGE_GEOREF};

uint64_t bench_cycles(void)
{
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#else
    return (uint64_t)clock_now_ns();
#endif
}

int bench_stages_create(struct bench_stages **out, struct sh_err *err)
{
    *out = calloc(1, sizeof **out);
    if (*out == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    (*out)->profile.now = bench_cycles;
    int rc = caster_create(&(*out)->caster, err);
    if (rc == SH_OK) caster_set_profile((*out)->caster, &(*out)->profile);
    return rc;
}

void bench_stages_free(struct bench_stages *stages)
{
    if (stages == NULL) return;
    caster_free(stages->caster);
    free(stages);
}

/* Gives the caster's cycles to its stages, and the other cycles between the marks to `other`. */
static void share(struct bench_stages *s, uint64_t from, uint64_t to, enum bench_stage other,
                  uint64_t cycles[BENCH_STAGES])
{
    uint64_t rest = to - from;
    for (int i = 0; i < CAST_STAGES; i++) {
        cycles[STAGE_OF[i]] += s->profile.spent[i];
        rest -= s->profile.spent[i] < rest ? s->profile.spent[i] : rest;
        s->profile.spent[i] = 0;
    }
    cycles[other] += rest;
}

size_t bench_stages_line(struct bench_stages *s, const struct cast_setup *setup, const struct schedule_segment *segment,
                         uint64_t line, uint64_t cycles[BENCH_STAGES], struct line_block *block, uint8_t *bytes,
                         size_t cap)
{
    struct schedule_line place;
    struct schedule_run run;
    uint64_t start = bench_cycles();
    schedule_get_line(segment, line, &place);
    schedule_get_run(segment, &place, place.cast0, (uint32_t)(place.cast_end - place.cast0), &run);
    caster_cast(s->caster, setup, &run, block);
    uint64_t cast = bench_cycles();
    share(s, start, cast, STAGE_SCHEDULE, cycles); /* times of the pulses belong to the schedule */
    size_t len = native_encode_points(bytes, cap, block, 0);
    uint64_t encoded = bench_cycles();
    /* The checksum, made within the encoder, is made once more by itself. The second checksum's time is taken from that
     * of the encoder. */
    volatile uint32_t crc = crc32c(0, bytes + NATIVE_HEADER_LEN, len - NATIVE_HEADER_LEN);
    (void)crc;
    uint64_t spent = bench_cycles() - encoded, encode = encoded - cast;
    cycles[STAGE_CRC] += spent;
    cycles[STAGE_ENCODE] += spent < encode ? encode - spent : 0;
    return len;
}
