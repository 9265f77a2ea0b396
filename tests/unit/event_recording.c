/* SPDX-License-Identifier: MIT */
#include "tests/unit/event_recording.h"

#include <setjmp.h>
#include <stdarg.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"

static uint32_t next_seq;

FILE *recording_begin(const char *path)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    next_seq = 0;
    return f;
}

void recording_end(FILE *f)
{
    assert_int_equal(fclose(f), 0);
}

void recording_put(FILE *f, uint8_t *frame, size_t len)
{
    assert_true(len > 0);
    native_finish_frame(frame, next_seq++);
    assert_int_equal(fwrite(frame, 1, len, f), len);
}

void recording_put_head(FILE *f, const char *idn, int flags)
{
    uint8_t frame[1024];
    struct native_descriptor d = {.prr_uhz = UINT64_C(1000000000000),
                                  .range_scale_m = 1,
                                  .scan = 1,
                                  .mirror_counts_per_turn = 1000,
                                  .pan_counts_per_turn = 1000};
    snprintf(d.idn, sizeof d.idn, "%s", idn);
    recording_put(f, frame, native_encode_descriptor(frame, sizeof frame, &d, 0, flags));
}

void recording_put_event(FILE *f, enum native_event_code code, int64_t t_ns)
{
    uint8_t frame[256];
    const struct native_event event = {.code = (uint32_t)code, .a = 1};
    recording_put(f, frame, native_encode_event(frame, sizeof frame, &event, t_ns, 0));
}

void event_recording_write(const char *path, int n_events)
{
    FILE *f = recording_begin(path);
    recording_put_head(f, "", 0);
    for (int ms = 0; ms < n_events; ms++)
        recording_put_event(f, NATIVE_EV_CONTROL, ms * INT64_C(1000000));
    recording_end(f);
}
