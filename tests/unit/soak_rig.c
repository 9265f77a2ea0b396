/* SPDX-License-Identifier: MIT */
#include "tests/unit/soak_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/fault/fault.h"

static struct config cfg;

struct soak *soak_rig_make(void)
{
    struct soak *soak = calloc(1, sizeof *soak);
    assert_non_null(soak);
    soak->cfg = &cfg;
    soak->realtime = 1;
    soak->n_links = 1;
    pthread_mutex_init(&soak->clean.lock, NULL);
    soak->clean.ring = calloc(SOAK_RING, sizeof *soak->clean.ring);
    struct soak_link *link = &soak->link[0];
    pthread_mutex_init(&link->lock, NULL);
    link->soak = soak;
    link->number = 1;
    link->usable = 1;
    link->fact = calloc(SOAK_RING, sizeof *link->fact);
    assert_true(soak->clean.ring != NULL && link->fact != NULL);
    soak_saw_open(link);
    /* The verdict needs these beside the links. */
    strcpy(soak->clean.idn, "a,b,c,d");
    strcpy(soak->clean.state, "scanning");
    soak->stats.have_hash = 1;
    return soak;
}

void soak_rig_end(struct soak *soak)
{
    free(soak->clean.ring);
    free(soak->link[0].fact);
    free(soak);
}

/* Makes a frame of the stream. damage: changes its payload, with a right checksum. */
static struct scanhead_frame frame_of(uint32_t seq, uint8_t damage, uint8_t raw[NATIVE_HEADER_LEN + PAYLOAD])
{
    memset(raw, 0, NATIVE_HEADER_LEN + PAYLOAD);
    memcpy(raw + 12, &(uint32_t){seq ^ damage}, 4); /* stands for the checksum */
    memcpy(raw + 24, &seq, 4);
    return (struct scanhead_frame){.type = SCANHEAD_LINE_END,
                                   .seq = seq,
                                   .t_ns = (int64_t)seq * TICK_NS,
                                   .raw = raw,
                                   .raw_len = NATIVE_HEADER_LEN + PAYLOAD};
}

void send_clean(struct soak *soak)
{
    for (uint32_t seq = FIRST; seq < FIRST + N_FRAMES; seq++) {
        uint8_t raw[NATIVE_HEADER_LEN + PAYLOAD];
        const struct scanhead_frame frame = frame_of(seq, 0, raw);
        const soak_seq at = soak_seq_of(soak, seq);
        soak->clean.ring[at % SOAK_RING] = (struct soak_clean_frame){
            .seq = at, .digest = soak_digest(&frame), .t_ns = frame.t_ns, .len = (uint32_t)frame.raw_len, .there = 1};
    }
}

void see(struct soak *soak, uint32_t seq, uint8_t damage, double late_ms)
{
    uint8_t raw[NATIVE_HEADER_LEN + PAYLOAD];
    const struct scanhead_frame frame = frame_of(seq, damage, raw);
    soak_saw_frame(&soak->link[0], &frame, frame.t_ns + (int64_t)(1e6 * late_ms));
}

void notice(struct soak *soak, enum scanhead_notice_kind kind, uint32_t seq, uint64_t n)
{
    const struct scanhead_notice it = {.kind = kind, .seq = seq, .n = n, .t_ns = (int64_t)(seq - 1) * TICK_NS};
    soak_saw_notice(&soak->link[0], &it);
}

void see_others(struct soak *soak, uint32_t from, uint32_t to)
{
    for (uint32_t seq = from; seq < to; seq++)
        see(soak, seq, 0, 0.0);
}

struct fault_note note_of(enum fault_kind kind, uint64_t n, double for_ms, const char *text)
{
    struct fault_note note = {.fault = 1,
                              .kind = kind,
                              .t_ns = (int64_t)HIT * TICK_NS,
                              .link = 1,
                              .session = 1,
                              .number = 5,
                              .has_seq = 1,
                              .seq = HIT,
                              .type = SCANHEAD_POINTS,
                              .byte = 30,
                              .n = n,
                              .for_ms = for_ms};
    snprintf(note.text, sizeof note.text, "%s", text);
    return note;
}

struct soak_row *inject(struct soak *soak, enum fault_kind kind, uint64_t n, double for_ms, const char *text)
{
    const struct fault_note note = note_of(kind, n, for_ms, text);
    send_clean(soak);
    see_others(soak, FIRST, HIT);
    soak_heard(soak, &note);
    return &soak->link[0].row[text[0] != '\0' ? SOAK_RESEALED : (int)kind];
}

uint32_t finish(struct soak *soak)
{
    see_others(soak, HIT + 1, FIRST + N_FRAMES);
    soak_judge(&soak->link[0], 1);
    soak_conclude(soak);
    return soak->n_failures;
}
