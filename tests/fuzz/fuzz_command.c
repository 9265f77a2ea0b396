/* SPDX-License-Identifier: MIT */
/* This fuzzes the command set: bytes as a client sends them, through the collector of lines, into the head's state
 * machine. The input is records of one byte (session, state event) and bytes up to the next NUL. A line must get one
 * reply of one line, an error must change nothing, and the settings must stay within the limits. */
#include <string.h>

#include "tests/fuzz/rig.h"
#include "tests/unit/command_device.h"

static void must_be_text(const char *reply)
{
    fuzz_must(strlen(reply) < COMMAND_MAX_REPLY - 1, "a reply is not cut");
    for (const char *c = reply; *c != '\0'; c++)
        fuzz_must((unsigned char)*c >= ' ' && *c < 0x7f, "a reply is printable text");
}

static int is_between(int64_t low, int64_t v, int64_t high)
{
    return low <= v && v <= high;
}

static void check_settings(const struct command_device *dev)
{
    const struct head_settings *s = &dev->settings;
    const struct head_limits *l = &dev->limits;
    fuzz_must(is_between(l->prr_min_uhz, s->prr_uhz, l->prr_max_uhz), "HEAD:PRR within its limits");
    fuzz_must(is_between(l->lines_min_uhz, s->lines_uhz, l->lines_max_uhz), "HEAD:LINes within its limits");
    fuzz_must(is_between(0, s->pan_udeg_s, l->pan_max_udeg_s), "HEAD:PAN within its limits");
    fuzz_must(is_between(l->fov_min_udeg, s->line_start_udeg, s->line_stop_udeg), "SCAN:LINE:STARt within");
    fuzz_must(is_between(s->line_start_udeg + 1, s->line_stop_udeg, l->fov_max_udeg), "SCAN:LINE:STOP within");
    fuzz_must(is_between(l->pan_min_udeg, s->pan_start_udeg, s->pan_stop_udeg), "SCAN:PAN:STARt within");
    fuzz_must(is_between(1, s->station, l->n_stations), "HEAD:STATION is one of the stations");
    fuzz_must(s->range_min_nm < s->range_max_nm, "the nearest range below the farthest");
    fuzz_must(s->noise <= l->noise_most && s->angle_noise <= l->angle_most, "kinds of noise that there are");
    fuzz_must(s->waves <= l->waves_most, "waveforms where there are some");
}

static void run_line(struct command_device *dev, uint32_t session, const char *line)
{
    static struct command_result out;
    const struct head_settings before = dev->settings;
    memset(&out, 0x5a, sizeof out);
    command_execute(dev, session, line, &out);
    must_be_text(out.reply);
    check_settings(dev);
    const int is_error = strncmp(out.reply, "ERR ", 4) == 0;
    fuzz_must(is_error == (out.error != 0), "an error has its number and its reply");
    if (is_error) {
        fuzz_must(memcmp(&before, &dev->settings, sizeof before) == 0, "what is refused changes nothing");
        fuzz_must(out.effect == COMMAND_NONE && !out.changes, "and has no effect");
    }
    if (out.effect == COMMAND_STEP) fuzz_must(out.step_ns > 0, "a step has a length");
}

static void take_event(struct command_device *dev, unsigned event)
{
    const int next = head_next_state(dev->state, (enum head_event)(event % HEAD_N_EVENTS));
    fuzz_must(next >= -1 && next < HEAD_N_STATES, "a state that there is");
    if (next >= 0) dev->state = (enum head_state)next;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct command_device dev = command_test_device();
    struct command_lines lines = {0};
    struct fuzz_bytes in = {data, size};
    if (size > 4096) return 0;
    dev.step_allowed = 1;
    while (in.n > 0) {
        const unsigned head = fuzz_u8(&in);
        if ((head & 0x80) != 0) take_event(&dev, head & 15);
        dev.pose_allowed = head >> 6 & 1;
        for (unsigned c; in.n > 0 && (c = fuzz_u8(&in)) != 0;) {
            const enum command_line_kind kind = command_lines_feed(&lines, (unsigned char)c);
            if (kind == COMMAND_LINE_READY) run_line(&dev, head >> 4 & 3, lines.buf);
            fuzz_must(strlen(lines.buf) <= COMMAND_MAX_LINE, "a line within its room");
        }
    }
    return 0;
}
