/* SPDX-License-Identifier: MIT */
#include "firmware_sim/replay/replay_clock.h"

#include <string.h>

#include "drivers/protocol/native.h"

static const int64_t LAST_NS = INT64_C(7258118400) * UTC_SECOND_NS; /* 2200-01-01 */

static int is_date(int64_t ns)
{
    return ns > 0 && ns < LAST_NS;
}

/* Returns the piece at a time. The oldest one that is kept also covers the time before. */
static const struct replay_clock_piece *piece_at(const struct replay_clock *clock, int64_t t_ns)
{
    const uint64_t kept = clock->n < REPLAY_CLOCK_KEPT ? clock->n : REPLAY_CLOCK_KEPT;
    uint64_t i = 1;
    while (i < kept && clock->piece[(clock->n - i) % REPLAY_CLOCK_KEPT].from_ns > t_ns)
        i++;
    return &clock->piece[(clock->n - i) % REPLAY_CLOCK_KEPT];
}

static void add_piece(struct replay_clock *clock, int64_t from_ns, int64_t utc0_ns)
{
    clock->piece[clock->n++ % REPLAY_CLOCK_KEPT] = (struct replay_clock_piece){from_ns, utc0_ns};
}

void replay_clock_begin(struct replay_clock *clock, int64_t t_ns, int64_t utc_ns)
{
    memset(clock, 0, sizeof *clock);
    if (!is_date(utc_ns)) return;
    clock->table = *utc_table_builtin();
    clock->tai0_ns = native_since_ns(utc_tai_from_posix(&clock->table, utc_ns), t_ns);
    add_piece(clock, t_ns, native_since_ns(utc_ns, t_ns));
}

static void take_telemetry(struct replay_clock *clock, int64_t t_ns, int64_t utc_ns)
{
    const int64_t utc0_ns = native_since_ns(utc_ns, t_ns);
    if (is_date(utc_ns) && utc0_ns != piece_at(clock, t_ns)->utc0_ns) add_piece(clock, t_ns, utc0_ns);
}

static void take_pps(struct replay_clock *clock, int64_t t_ns, const struct native_event *event)
{
    static const char LEAP[] = ":60Z";
    const int64_t utc0_ns = piece_at(clock, t_ns)->utc0_ns, shown_ns = native_after_ns(utc0_ns, t_ns);
    const size_t len = strlen(event->text), end = sizeof LEAP - 1;
    if (event->a >= (uint64_t)(LAST_NS / UTC_SECOND_NS) || !is_date(shown_ns)) return;
    const int64_t second = (int64_t)event->a, ahead_s = second - (shown_ns + UTC_SECOND_NS / 2) / UTC_SECOND_NS;
    if (ahead_s != 0) add_piece(clock, t_ns, native_after_ns(utc0_ns, ahead_s * UTC_SECOND_NS));
    if (len <= end || strcmp(event->text + len - end, LEAP) != 0) return;
    /* The head's clock may be behind the receiver, for which that second is over: it would go back. */
    if (replay_clock_receiver_ns(clock, t_ns) < second * UTC_SECOND_NS + UTC_SECOND_NS / 2)
        utc_table_add(&clock->table, second);
}

void replay_clock_take(struct replay_clock *clock, const uint8_t *frame, int64_t shift_ns)
{
    struct native_header header;
    struct native_telemetry telemetry;
    struct native_event event;
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    native_read_header(frame, &header);
    if (clock->n == 0) return;
    if (header.type == NATIVE_TELEMETRY && native_decode_telemetry(payload, header.length, &telemetry) == SH_OK)
        take_telemetry(clock, native_after_ns(header.t_ns, shift_ns), telemetry.utc_ns);
    if (header.type == NATIVE_EVENT && native_decode_event(payload, header.length, &event) == SH_OK &&
        event.code == NATIVE_EV_PPS)
        take_pps(clock, native_after_ns((int64_t)event.b, shift_ns), &event);
}

void replay_clock_shift(struct replay_clock *clock, int64_t shift_ns)
{
    clock->tai0_ns = native_since_ns(clock->tai0_ns, shift_ns);
    for (int i = 0; i < REPLAY_CLOCK_KEPT; i++) {
        struct replay_clock_piece *piece = &clock->piece[i];
        piece->from_ns = native_after_ns(piece->from_ns, shift_ns);
        piece->utc0_ns = native_since_ns(piece->utc0_ns, shift_ns);
    }
}

int64_t replay_clock_head_ns(const struct replay_clock *clock, int64_t t_ns)
{
    if (clock->n == 0) return INT64_MIN;
    const int64_t utc_ns = native_after_ns(piece_at(clock, t_ns)->utc0_ns, t_ns);
    return is_date(utc_ns) ? utc_ns : INT64_MIN;
}

int64_t replay_clock_receiver_ns(const struct replay_clock *clock, int64_t t_ns)
{
    const int64_t tai_ns = native_after_ns(clock->tai0_ns, t_ns);
    if (clock->n == 0 || tai_ns <= 0) return INT64_MIN;
    const int64_t utc_ns = utc_posix_from_tai(&clock->table, tai_ns);
    return is_date(utc_ns) ? utc_ns : INT64_MIN;
}

void replay_clock_receiver_utc(const struct replay_clock *clock, int64_t t_ns, struct utc_time *utc)
{
    utc_from_tai(&clock->table, native_after_ns(clock->tai0_ns, t_ns), utc);
}
