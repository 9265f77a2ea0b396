/* SPDX-License-Identifier: MIT */
#include "tests/unit/event_recording.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"

static void put_frame(FILE *f, uint8_t *frame, size_t len, uint32_t seq)
{
    assert_true(len > 0);
    native_finish_frame(frame, seq);
    assert_int_equal(fwrite(frame, 1, len, f), len);
}

void event_recording_write(const char *path, int n_events)
{
    uint8_t frame[1024];
    const struct native_descriptor d = {.prr_uhz = UINT64_C(1000000000000),
                                        .range_scale_m = 1,
                                        .scan = 1,
                                        .mirror_counts_per_turn = 1000,
                                        .pan_counts_per_turn = 1000};
    const struct native_event event = {.code = NATIVE_EV_CONTROL, .a = 1};
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    put_frame(f, frame, native_encode_descriptor(frame, sizeof frame, &d, 0, 0), 0);
    for (int ms = 0; ms < n_events; ms++)
        put_frame(f, frame, native_encode_event(frame, sizeof frame, &event, ms * INT64_C(1000000), 0),
                  1 + (uint32_t)ms);
    assert_int_equal(fclose(f), 0);
}
