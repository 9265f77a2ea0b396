/* SPDX-License-Identifier: MIT */
#include "tests/wire/beam_run.h"

const struct room_config BEAM_ROOM = {.prr_hz = 20000,
                                      .lines_hz = 50,
                                      .pan_deg_s = 60,
                                      .pan_stop_deg = 24,
                                      .frames = 1,
                                      .links = LINK_YAML_TCP,
                                      .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

static struct beam_run runs[2];

static struct beam_shot *shot_at(struct beam_run *run, uint64_t pulse)
{
    assert_true(pulse < BEAM_MAX_PULSES);
    if (pulse >= run->pulses) run->pulses = pulse + 1;
    return &run->shot[pulse];
}

/* A pulse has one echo at most, so an entry is a pulse. */
static void take_points(struct beam_run *run, struct scanhead *sh, const struct scanhead_frame *frame)
{
    struct scanhead_point point[256];
    assert_int_equal(frame->n_points, frame->n_pulses);
    for (uint32_t first = 0; first < frame->n_points; first += 256) {
        const int got = scanhead_points(sh, frame, first, point, 256);
        for (int i = 0; i < got; i++) {
            struct beam_shot *shot = shot_at(run, frame->pulse0 + first + (uint32_t)i);
            assert_false(shot->is_there);
            *shot = (struct beam_shot){.is_there = 1,
                                       .is_empty = point[i].echo_count == 0,
                                       .range_m = point[i].range_m,
                                       .mirror_rad = point[i].mirror_rad,
                                       .pan_rad = point[i].pan_rad,
                                       .reflectance_db = point[i].reflectance_db,
                                       .amplitude_db = (double)NAN,
                                       .t_ns = point[i].t_ns};
        }
    }
}

static void take_attributes(struct beam_run *run, struct scanhead *sh, const struct scanhead_frame *frame)
{
    struct scanhead_attribute attribute[256];
    for (uint32_t first = 0; first < frame->n_points; first += 256) {
        const int got = scanhead_attributes(sh, frame, first, attribute, 256);
        for (int i = 0; i < got; i++)
            shot_at(run, frame->pulse0 + first + (uint32_t)i)->amplitude_db = attribute[i].amplitude_db;
    }
}

static void read_stream(struct beam_run *run, const char *path)
{
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(path);
    scanhead_hash_start(sh);
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_POINTS) take_points(run, sh, &frame);
        if (frame.type == SCANHEAD_POINTS && frame.pulse0 == 0) run->start_ns = frame.t_ns - run->shot[0].t_ns;
        if (frame.type == SCANHEAD_ATTRIBUTES) take_attributes(run, sh, &frame);
        if (frame.type != SCANHEAD_LINE_END) continue;
        assert_true(run->lines < BEAM_MAX_LINES);
        assert_int_equal(scanhead_line_end(sh, &frame, &run->line[run->lines++]), SCANHEAD_OK);
    }
    assert_int_equal(scanhead_get_info(sh, &run->info), SCANHEAD_OK);
    scanhead_hash_hex(sh, run->sha256);
    scanhead_close(sh);
}

static void read_truth(struct beam_run *run, const char *path)
{
    size_t len;
    char *text = wire_read(path, &len);
    for (char *line = strtok(text, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        struct beam_note *note = &run->note[run->notes];
        assert_true(run->notes < BEAM_MAX_NOTES);
        const char *kind = strstr(line, "\"kind\":\""), *t = strstr(line, "\"t_ns\":"), *p = strstr(line, "\"pulse\":");
        assert_true(kind != NULL && t != NULL);
        if (p == NULL) continue;
        assert_int_equal(sscanf(kind, "\"kind\":\"%31[a-z_]", note->kind), 1);
        assert_int_equal(sscanf(t, "\"t_ns\":%" SCNd64, &note->t_ns), 1);
        assert_int_equal(sscanf(p, "\"pulse\":%" SCNu64, &note->pulse), 1);
        note->ended = strstr(line, "\"ended\":true") != NULL;
        run->notes++;
    }
    free(text);
}

const struct beam_run *beam_read(const struct wire *wire, int slot, const char *stream, const char *truth)
{
    struct beam_run *run = &runs[slot];
    char path[352];
    memset(run, 0, sizeof *run);
    snprintf(path, sizeof path, "%s", wire_path(wire, stream));
    read_stream(run, path);
    if (truth != NULL) read_truth(run, wire_path(wire, truth));
    return run;
}

const struct beam_run *beam_record(struct wire *wire, int slot, const char *faults, const char *const *sets)
{
    return beam_record_room(wire, slot, &BEAM_ROOM, faults, sets);
}

const struct beam_run *beam_record_room(struct wire *wire, int slot, const struct room_config *of, const char *faults,
                                        const char *const *sets)
{
    const char *args[WIRE_MAX_ARGS] = {"record"};
    char config[352], stream[352], truth[352], more[2048];
    struct room_config room = *of;
    int n = 1;
    snprintf(more, sizeof more, "%s%s%s", of->more, faults != NULL ? "faults:\n" : "", faults != NULL ? faults : "");
    room.more = more;
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &room));
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "run.shs"));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    const char *const fixed[] = {config, "-o", stream, "--truth", truth, "--quiet"};
    for (size_t i = 0; i < sizeof fixed / sizeof fixed[0]; i++)
        args[n++] = fixed[i];
    for (; sets != NULL && *sets != NULL; sets++) {
        args[n++] = "--set";
        args[n++] = *sets;
    }
    wire_run(wire, args, 0);
    return beam_read(wire, slot, "run.shs", "truth.json");
}

const struct beam_note *beam_note(const struct beam_run *run, const char *kind, uint32_t n, int ended)
{
    for (uint32_t i = 0; i < run->notes; i++)
        if (strcmp(run->note[i].kind, kind) == 0 && run->note[i].ended == ended && n-- == 0) return &run->note[i];
    fail_msg("no such note of %s", kind);
    return NULL;
}
