/* SPDX-License-Identifier: MIT */
/* A recording is opened: what links learn of its head, the time of day of a device, and the answers of the source
 * that the loop asks (loop/source.h). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/replay/replay_state.h"
#include "tests/unit/event_recording.h"
#include "tests/unit/file_rig.h"

#define S INT64_C(1000000000)

/* ---- recordings */

static FILE *file;
static uint8_t front[4096]; /* the descriptor, the emitter and the anchor that were written */
static uint32_t front_len;
static struct config *cfg;

static void file_begin(void)
{
    file = recording_begin(file_path);
    front_len = 0;
}

static void file_end(void)
{
    recording_end(file);
}

static void put(uint8_t *frame, size_t len)
{
    recording_put(file, frame, len);
}

static void put_front(uint8_t *frame, size_t len)
{
    put(frame, len);
    memcpy(front + front_len, frame, len);
    front_len += (uint32_t)len;
}

static void put_event(int64_t t_ns, int flags)
{
    uint8_t frame[256];
    const struct native_event event = {.code = NATIVE_EV_CONTROL, .a = 1};
    put(frame, native_encode_event(frame, sizeof frame, &event, t_ns, flags));
}

static struct native_descriptor descriptor_of(const char *idn, const char *profile)
{
    struct native_descriptor d = {.prr_uhz = UINT64_C(1000000000000),
                                  .lines_uhz = 50000000,
                                  .range_scale_m = 1,
                                  .scan = 1,
                                  .mirror_counts_per_turn = 1000,
                                  .pan_counts_per_turn = 1000};
    snprintf(d.idn, sizeof d.idn, "%s", idn);
    snprintf(d.profile, sizeof d.profile, "%s", profile);
    return d;
}

static void put_descriptor(const struct native_descriptor *d, int64_t t_ns)
{
    uint8_t frame[1024];
    put_front(frame, native_encode_descriptor(frame, sizeof frame, d, t_ns, 0));
}

static void put_anchor(double lat_deg, int64_t t_ns)
{
    uint8_t frame[1024];
    const struct native_anchor a = {.station = 3, .lat_deg = lat_deg, .lon_deg = 8.0, .scale_m = 1e-4};
    put_front(frame, native_encode_anchor(frame, sizeof frame, &a, t_ns, 0));
}

static void put_telemetry(int64_t utc_ns, int64_t t_ns)
{
    uint8_t frame[1024];
    const struct native_telemetry t = {.utc_ns = utc_ns};
    put(frame, native_encode_telemetry(frame, sizeof frame, &t, t_ns, 0));
}

static void file_of(const struct native_descriptor *d)
{
    file_begin();
    put_descriptor(d, 0);
    put_event(S / 2, 0);
    file_end();
}

/* ---- opening */

static int setup(void **state)
{
    (void)state;
    cfg = calloc(1, sizeof *cfg);
    if (cfg == NULL) return -1;
    cfg->loop.tick_hz = 1000;
    strcpy(cfg->file, "run.yaml");
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(cfg);
    return 0;
}

static const struct replay_options plain = {.path = file_path, .speed = 1};

static const char *said(struct replay *r, const char *line)
{
    static struct command_result result;
    replay_source.command(r, 1, line, 0, &result);
    return result.reply;
}

static struct replay *open_with(const struct replay_options *options)
{
    struct replay *r;
    struct sh_err err;
    if (replay_open(cfg, options, &r, &err) != SH_OK) fail_msg("%s", err.text);
    return r;
}

static void expect_refused(const struct replay_options *options, int code, const char *text)
{
    struct replay *r;
    struct sh_err err = {0};
    assert_int_equal(replay_open(cfg, options, &r, &err), code);
    assert_string_equal(err.text, text);
    assert_null(r);
}

static void links_learn_what_the_head_is(void **state)
{
    (void)state;
    struct native_descriptor d = descriptor_of("Maker,Model,SN-1,scanhead native 1", "some-head");
    d.sweep_udeg = 90000000;
    d.content = NATIVE_HAS_ATTRIBUTES;
    file_of(&d);
    cfg->n_links = 3;
    cfg->link[0].type = LINK_USB;
    cfg->link[0].own_serial = 1;
    cfg->link[1].type = LINK_USB;
    strcpy(cfg->link[1].serial, "given");
    cfg->link[2].type = LINK_TCP;
    cfg->link[2].own_serial = 1;
    cfg->link[3].protocol = PROTOCOL_NMEA; /* there is no such link */
    struct replay *r = open_with(&(struct replay_options){.path = file_path, .speed = 2.5});
    assert_string_equal(cfg->profile.maker, "Maker");
    assert_string_equal(cfg->profile.model, "Model");
    assert_string_equal(cfg->head.serial, "SN-1");
    assert_string_equal(cfg->profile.name, "some-head");
    assert_string_equal(cfg->link[0].serial, "SN-1");
    assert_string_equal(cfg->link[1].serial, "given");
    assert_string_equal(cfg->link[2].serial, "");
    assert_true(cfg->profile.facets == 1 && cfg->profile.optical_gain == 0.25); /* a sweep is a quarter of a turn */
    assert_true(cfg->head.settings.prr_uhz == INT64_C(2500000000000));
    assert_true(cfg->head.settings.lines_uhz == 50000000);
    assert_true(cfg->output.attributes && cfg->output.colour == COLOUR_NONE);
    assert_non_null(strstr(said(r, "HEAD:PRR 1 HZ"), "a recording is replayed; its settings are fixed"));
    assert_string_equal(cfg->profile.firmware, ""); /* the native protocol does not ask for it */
    replay_free(r);

    d.sweep_udeg = 0;
    d.content = NATIVE_HAS_COLOURS;
    d.prr_uhz = UINT64_C(900000000000000);
    file_of(&d);
    r = open_with(&(struct replay_options){.path = file_path, .speed = 2});
    assert_true(cfg->profile.optical_gain == 1.0);
    assert_true(!cfg->output.attributes && cfg->output.colour == COLOUR_SOLID);
    assert_true(cfg->head.settings.prr_uhz == INT64_C(1000000000000000)); /* 1 GHz is the most */
    replay_free(r);
}

/* A name has fewer parts, or they are longer than their fields. */
static void a_name_fills_its_fields(void **state)
{
    (void)state;
    struct native_descriptor d = descriptor_of("Maker,Model", "");
    file_of(&d);
    replay_free(open_with(&plain));
    assert_string_equal(cfg->profile.model, "Model");
    assert_string_equal(cfg->head.serial, "");
    d = descriptor_of("Maker", "");
    file_of(&d);
    replay_free(open_with(&plain));
    assert_string_equal(cfg->profile.maker, "Maker");
    assert_string_equal(cfg->profile.model, "");
    d = descriptor_of("0123456789012345678901234567890123456789,M,0123456789012345678901234567890123456789,", "");
    file_of(&d);
    replay_free(open_with(&plain));
    assert_string_equal(cfg->profile.maker, "0123456789012345678901234567890");
    assert_string_equal(cfg->profile.model, "M");
    assert_string_equal(cfg->head.serial, "0123456789012345678901234567890");
}

/* ---- the source */

/* The description is the recorded one, wherever it stands in the recording. A second descriptor before the first anchor
 * replaces the first descriptor. The first descriptor's emitter then no longer counts. */
static void it_describes_the_recorded_head(void **state)
{
    (void)state;
    uint8_t frame[1024];
    const struct native_emitter e = {
        .kind = NATIVE_EMIT_PLANAR, .steps = 1440, .last_step = 1080, .turn = 1, .sequence_ns_den = 1};
    const struct native_descriptor d = descriptor_of("A,B,C,", ""), other = descriptor_of("D,E,F,", "");
    struct ring_tick tick;
    for (int has_other = 0; has_other <= 1; has_other++) {
        file_begin();
        put_event(S, NATIVE_LOCAL);
        put_event(S, 0);
        put_anchor(40.0, S); /* of a lost descriptor */
        front_len = 0;
        put_descriptor(&d, S);
        put_front(frame, native_encode_emitter(frame, sizeof frame, &e, NULL, S, 0));
        if (has_other) front_len = 0;
        if (has_other) put_descriptor(&other, S);
        put_anchor(50.0, S);
        const uint32_t len = front_len;
        put_descriptor(&d, 2 * S);
        file_end();
        struct replay *r = open_with(&plain);
        replay_source.describe(r, &tick);
        assert_int_equal(tick.len, len);
        assert_memory_equal(tick.bytes, front, len);
        assert_string_equal(cfg->profile.maker, has_other ? "D" : "A");
        assert_true(r->cmd.settings.station == 3 && r->cmd.limits.n_stations == 3);
        assert_int_equal(r->cmd.limits.emitter, has_other ? EMITTER_LINE : EMITTER_PLANAR);
        assert_int_equal(r->cmd.limits.line_pulses, has_other ? 0 : 1440);
        replay_free(r);
    }
}

static void the_loop_learns_its_sizes(void **state)
{
    (void)state;
    struct native_descriptor d = descriptor_of("A,B,C,", "");
    struct sh_err err;
    file_of(&d);
    cfg->loop.tick_hz = 250;
    struct replay *r = open_with(&plain);
    assert_true(replay_source.tick_ns(r) == 4000000);
    /* Each of 4,000 pulses a tick may have two points of 20 bytes. */
    assert_int_equal(replay_source.usual_bytes(r), 131072); /* the most: 128 KiB */
    assert_int_equal(replay_source.most_bytes(r), REPLAY_MOST_BYTES + REPLAY_FRONT * REPLAY_FRONT_ROOM);
    replay_free(r);
    cfg->loop.tick_hz = 1000;
    r = open_with(&plain);
    assert_int_equal(replay_source.usual_bytes(r), 4096 + 1000 * 2 * 20);
    assert_int_equal(replay_source.last_power(r, 0).ons, 1);
    assert_true(replay_source.last_power(r, 0).t_ns == 0);
    assert_true(replay_source.scans(r) == 0);
    assert_ptr_equal(replay_source.counters(r), &r->counters);
    const struct talk_options *options = NULL;
    assert_null(replay_source.talk(r, 0, &options));
    assert_ptr_equal(options, &r->options.talk_options);
    assert_int_equal(replay_source.files_fill(r), 0);
    assert_int_equal(replay_source.close_files(r, &err), SH_OK);
    replay_free(r);
}

/* A capture in place of a recording: a talk for each link. */
static void talks_are_those_of_links(void **state)
{
    (void)state;
    const struct talk one = {.n_requests = 1}, two = {.n_requests = 2};
    const struct talk *const talks[] = {&one, &two};
    const struct talk_options *options = NULL;
    cfg->n_links = 2;
    struct replay *r = open_with(&(struct replay_options){.path = file_path, .speed = 1, .talk = talks});
    assert_ptr_equal(replay_source.talk(r, 0, &options), &one);
    assert_ptr_equal(replay_source.talk(r, 1, &options), &two);
    assert_null(replay_source.talk(r, 2, &options));
    assert_string_equal(said(r, "*IDN?"), "");
    assert_non_null(strstr(said(r, "HEAD:PRR 1 HZ"), "a recording is replayed; its settings are fixed"));
    replay_free(r);
}

/* ---- faults */

static void faults_of_links_alone_are_injected(void **state)
{
    (void)state;
    const struct native_descriptor d = descriptor_of("A,B,C,", "");
    struct fault_entry entries[FAULT_MAX];
    uint32_t n;
    file_of(&d);
    cfg->faults.n = 2;
    cfg->faults.fault[0].kind = FAULT_DROP;
    cfg->faults.fault[1].kind = FAULT_STALL;
    struct replay *r = open_with(&plain);
    fault_board_copy(replay_source.faults(r), entries, &n);
    assert_true(n == 2 && entries[0].fault.kind == FAULT_DROP && entries[1].fault.kind == FAULT_STALL);
    replay_free(r);
    cfg->faults.fault[1].kind = FAULT_WINDOW_SOILED;
    expect_refused(&plain, SH_EINPUT,
                   "fault 2, window_soiled: it is a fault in the head, but a recording has no head; allowed are faults "
                   "on the wire and of links");
    cfg->faults.n = 1;
    expect_refused(&(struct replay_options){.path = file_path, .speed = 1, .truth = "/nowhere/truth"}, SH_EINPUT,
                   "truth: /nowhere/truth: cannot be opened for writing: No such file or directory");
}

/* ---- what can't be opened */

static void a_stream_has_a_descriptor(void **state)
{
    (void)state;
    char text[256];
    file_begin();
    put_event(0, 0);
    put_anchor(50.0, 0);
    file_end();
    snprintf(text, sizeof text, "%s: it has no descriptor: it is not a recording of a head's stream", file_path);
    expect_refused(&plain, SH_EINPUT, text);
    char path[4200];
    memset(path, 'x', sizeof path - 1);
    path[sizeof path - 1] = '\0';
    snprintf(text, sizeof text, "%.100s...: path too long; allowed up to %d bytes", path, 4095);
    expect_refused(&(struct replay_options){.path = path, .speed = 1}, SH_EINPUT, text);
}

/* ---- a device */

/* Opens the recording as that of a GNSS receiver, which needs the time of day. The recording begins at device time t0.
 * Its telemetry comes after_ns later, and says a time of 2026. */
static int open_receiver(int64_t t0_ns, int64_t after_ns, int is_first_local)
{
    static const int64_t UTC_NS = INT64_C(1772366400) * S; /* date -u -d 2026-03-01T12:00:00 +%s */
    const struct native_descriptor d = descriptor_of("A,B,C,", "");
    struct replay *r;
    struct sh_err err = {0};
    file_begin();
    if (is_first_local) put_event(t0_ns - S, NATIVE_LOCAL);
    put_descriptor(&d, t0_ns);
    put_anchor(50.0, t0_ns);
    put_telemetry(UTC_NS, t0_ns + after_ns);
    put_telemetry(UTC_NS, t0_ns + after_ns + 5 * S); /* the first one counts */
    file_end();
    cfg->n_links = 1;
    cfg->link[0].protocol = PROTOCOL_NMEA;
    const int rc = replay_open(cfg, &plain, &r, &err);
    if (rc == SH_OK) assert_true(replay_date_ns(r, 7) == UTC_NS - t0_ns - after_ns + 7);
    if (rc != SH_OK) assert_non_null(strstr(err.text, "has no time of day"));
    replay_free(r);
    return rc;
}

/* Telemetry comes each second, so the first two seconds have it. */
static void the_time_of_day_is_that_of_the_first_telemetry(void **state)
{
    (void)state;
    for (int local = 0; local <= 1; local++) {
        assert_int_equal(open_receiver(0, S / 2, local), SH_OK);
        assert_int_equal(open_receiver(100 * S, 2 * S, local), SH_OK);
        assert_int_equal(open_receiver(100 * S, 2 * S + 1, local), SH_EINPUT);
    }
}

/* Other protocols report the firmware. The profile's is reported if the profile has the recorded model. */
static void a_device_has_the_firmware_of_its_profile(void **state)
{
    (void)state;
    struct config_profile *profile = calloc(1, sizeof *profile);
    struct sh_err err;
    assert_non_null(profile);
    if (config_load_profile("sick-lms111", "", profile, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(strlen(profile->firmware) > 0);
    for (int is_other = 0; is_other <= 1; is_other++) {
        char idn[96];
        snprintf(idn, sizeof idn, "SICK,%s%s,1,", profile->model, is_other ? "x" : "");
        const struct native_descriptor d = descriptor_of(idn, "sick-lms111");
        file_begin();
        put_descriptor(&d, 0);
        put_anchor(50.0, 0);
        put_telemetry(S, 0);
        file_end();
        memset(&cfg->profile, 0, sizeof cfg->profile);
        cfg->n_links = 1;
        cfg->link[0].protocol = PROTOCOL_NMEA;
        replay_free(open_with(&plain));
        assert_string_equal(cfg->profile.firmware, is_other ? "" : profile->firmware);
    }
    free(profile);
}

static void speeds_that_are_fixed(void **state)
{
    (void)state;
    const struct native_descriptor d = descriptor_of("A,B,C,", "");
    file_begin();
    put_descriptor(&d, 7 * S);
    put_anchor(50.0, 7 * S);
    put_telemetry(S, 7 * S);
    put_event(11 * S, 0);
    file_end();
    struct replay *r = open_with(&(struct replay_options){.path = file_path, .speed = 1, .to_s = 2.5});
    assert_string_equal(said(r, "SCAN:REPL?"), "IDLE,0.000000,2.500000,1,OFF");
    assert_string_equal(said(r, "SCAN:REPL ,2"), "OK");
    replay_free(r);
    r = open_with(&(struct replay_options){.path = file_path, .speed = 1, .to_s = 9});
    assert_string_equal(said(r, "SCAN:REPL?"), "IDLE,0.000000,4.000000,1,OFF");
    replay_free(r);
    cfg->loop.pace = PACE_STEP;
    r = open_with(&plain);
    assert_non_null(strstr(said(r, "SCAN:REPL ,2"), "only the pace realtime has others"));
    replay_free(r);
    cfg->loop.pace = PACE_REALTIME;
    cfg->n_links = 1;
    cfg->link[0].protocol = PROTOCOL_NMEA;
    r = open_with(&plain);
    assert_non_null(strstr(said(r, "SCAN:REPL ,2"), "a link's times are those of the device"));
    replay_free(r);
}

#define WITH_CONFIG(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        WITH_CONFIG(links_learn_what_the_head_is),
        WITH_CONFIG(a_name_fills_its_fields),
        WITH_CONFIG(it_describes_the_recorded_head),
        WITH_CONFIG(the_loop_learns_its_sizes),
        WITH_CONFIG(talks_are_those_of_links),
        WITH_CONFIG(faults_of_links_alone_are_injected),
        WITH_CONFIG(a_stream_has_a_descriptor),
        WITH_CONFIG(the_time_of_day_is_that_of_the_first_telemetry),
        WITH_CONFIG(a_device_has_the_firmware_of_its_profile),
        WITH_CONFIG(speeds_that_are_fixed),
    };
    return cmocka_run_group_tests_name("replay, opened", tests, make_file, remove_file);
}
