/* SPDX-License-Identifier: MIT */
/* SAMPLES.md beside the program: its frames are those of the encoder, and its session is the head's. */
#include "tests/wire/room.h"

#include <nettle/sha2.h>

#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/native_waves.h"

static const char page_path[] = "drivers/protocol/SAMPLES.md";

/* Returns the text from line n on, counted from 0 among the lines that begin so; NULL: there are fewer. */
static const char *find_line(const char *text, const char *begin, int n)
{
    for (const char *at = text; (at = strstr(at, begin)) != NULL; at++)
        if ((at == text || at[-1] == '\n') && n-- == 0) return at;
    return NULL;
}

/* ---- frames */

/* Writes block n of hex into bytes. Returns how many there are, or 0. */
static size_t read_hex(const char *page, int n, uint8_t *bytes, size_t room)
{
    size_t len = 0;
    const char *at = find_line(page, "```text\nd5 ", n);
    if (at == NULL) return 0;
    for (at = strchr(at, '\n') + 1; *at != '`'; at += 3, len++) {
        unsigned byte;
        assert_true(len < room);
        assert_int_equal(sscanf(at, "%2x", &byte), 1);
        bytes[len] = (uint8_t)byte;
    }
    return len;
}

/* Adds the windows in a frame of waveforms to those of a block. */
static void take_waves(const uint8_t *frame, struct line_waves *waves)
{
    struct native_waves head;
    size_t at = NATIVE_WAVES_HEAD_LEN;
    assert_int_equal(native_decode_waves(frame + 28, le_get32(frame + 4), &head), 0);
    waves->sample_ps = head.sample_ps;
    waves->baseline_16 = head.baseline_16;
    waves->bits = head.bits;
    waves->count_signal = head.count_signal;
    waves->n_left_out = head.n_lost;
    for (uint32_t i = 0; i < head.n_windows; i++) {
        struct native_wave w;
        at = native_decode_wave(frame + 28, at, &w);
        waves->wave[waves->n++] = (struct line_wave){w.pulse, w.dt_ns, w.first, w.n, waves->n_samples, w.a, w.b, w.c};
        for (uint32_t k = 0; k < w.n; k++)
            waves->sample[waves->n_samples++] = le_get16(w.sample + 2 * k);
    }
}

/* Encodes a block. The block's attributes come from the frame after it, its colours from the one after that, its
 * waveforms from the next. */
static size_t encode_block(const uint8_t *frame, const uint8_t *next, uint8_t *out, size_t room)
{
    struct native_header header;
    struct native_points points;
    struct native_attributes attributes;
    struct line_block block;
    native_read_header(frame, &header);
    assert_int_equal(native_decode_points(frame + 28, header.length, &points), 0);
    assert_int_equal(native_decode_attributes(next + 28, le_get32(next + 4), &attributes), 0);
    const uint8_t *colours = next + native_frame_len(next);
    assert_int_equal(native_decode_colours(colours + 28, le_get32(colours + 4), &attributes), 0);
    assert_int_equal(line_block_alloc(&block, points.n_points, NULL), 0);
    assert_int_equal(line_block_alloc_attributes(&block, NULL), 0);
    assert_int_equal(line_block_alloc_colours(&block, NULL), 0);
    assert_int_equal(line_block_alloc_deviations(&block, NULL), 0);
    assert_int_equal(line_block_alloc_waves(&block, 8, 64, NULL), 0);
    take_waves(colours + native_frame_len(colours), block.waves);
    block.frame = points.frame;
    block.line = points.line;
    block.pulse0 = points.pulse0;
    block.n_pulses = points.n_pulses;
    block.t0_ns = points.t0_ns;
    block.line_t0_ns = points.line_t0_ns;
    block.layout = LINE_POLAR;
    block.n_points = points.n_points;
    for (uint32_t i = 0; i < points.n_points; i++) {
        struct native_point p;
        struct native_attribute a;
        native_decode_point(frame + 28, i, &p);
        native_decode_attribute(next + 28, i, &a);
        block.a[i] = p.a;
        block.b[i] = p.b;
        block.c[i] = p.c;
        block.refl_cdb[i] = p.refl_cdb;
        block.label[i] = p.label;
        block.dt_ns[i] = p.dt_ns;
        block.echo[i] = (uint8_t)(p.echo | p.echo_count << 4);
        block.amplitude_cdb[i] = a.amplitude_cdb;
        block.width_cns[i] = a.width_cns;
        memcpy(block.rgb[i], colours + 28 + 16 + 3 * (size_t)i, 3);
        block.deviation[i] = native_decode_deviation(next + 28, points.n_points, i);
    }
    size_t len = native_encode_points(out, room, &block, header.t_ns - points.t0_ns);
    line_block_free(&block);
    return len;
}

struct names {
    char object[4][64], material[4][64];
    uint32_t n;
};

static void keep_name(void *ctx, uint32_t label, const char *object, const char *material)
{
    struct names *names = ctx;
    snprintf(names->object[label], 64, "%s", object);
    snprintf(names->material[label], 64, "%s", material);
    names->n = label + 1;
}

static void give_name(void *ctx, uint32_t label, const char **object, const char **material)
{
    const struct names *names = ctx;
    *object = names->object[label];
    *material = names->material[label];
}

static size_t encode_names(const uint8_t *payload, size_t len, int64_t t_ns, uint8_t *out, size_t room)
{
    struct names names = {.n = 0};
    assert_int_equal(native_decode_surfaces(payload, len, keep_name, &names), 0);
    struct native_names all = {0, names.n, give_name, &names};
    return native_encode_surfaces(out, room, NATIVE_MAX_PAYLOAD, &all, t_ns);
}

static size_t encode_poses(const uint8_t *payload, size_t len, int64_t t_ns, uint8_t *out, size_t room)
{
    struct native_pose pose[8];
    uint32_t n;
    assert_int_equal(native_decode_poses(payload, len, &n), 0);
    for (uint32_t i = 0; i < n; i++)
        native_decode_pose(payload, i, &pose[i]);
    return native_encode_poses(out, room, pose, n, t_ns, 0);
}

static size_t encode_emitter(const uint8_t *payload, size_t len, int64_t t_ns, uint8_t *out, size_t room)
{
    struct native_emitter e;
    struct native_beam beam[NATIVE_MAX_BEAMS];
    assert_int_equal(native_decode_emitter(payload, len, &e), 0);
    for (uint32_t i = 0; i < e.n_beams; i++)
        native_decode_beam(payload, i, &beam[i]);
    return native_encode_emitter(out, room, &e, beam, t_ns, 0);
}

/* Decodes the frame and writes it anew. Returns the length of all frames that it gives. */
static size_t encode_again(const uint8_t *frame, const uint8_t *next, uint8_t *out, size_t room)
{
    struct native_header h;
    union {
        struct native_descriptor descriptor;
        struct native_anchor anchor;
        struct native_telemetry telemetry;
        struct native_event event;
        struct line_end end;
    } d;
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    native_read_header(frame, &h);
    switch (h.type) {
    case NATIVE_DESCRIPTOR:
        assert_int_equal(native_decode_descriptor(payload, h.length, &d.descriptor), 0);
        return native_encode_descriptor(out, room, &d.descriptor, h.t_ns, h.flags);
    case NATIVE_ANCHOR:
        assert_int_equal(native_decode_anchor(payload, h.length, &d.anchor), 0);
        return native_encode_anchor(out, room, &d.anchor, h.t_ns, h.flags);
    case NATIVE_POINTS:
        return encode_block(frame, next, out, room);
    case NATIVE_LINE_END:
        assert_int_equal(native_decode_line_end(payload, h.length, &d.end), 0);
        return native_encode_line_end(out, room, &d.end, h.t_ns - d.end.t1_ns);
    case NATIVE_TELEMETRY:
        assert_int_equal(native_decode_telemetry(payload, h.length, &d.telemetry), 0);
        return native_encode_telemetry(out, room, &d.telemetry, h.t_ns, h.flags);
    case NATIVE_EVENT:
        assert_int_equal(native_decode_event(payload, h.length, &d.event), 0);
        return native_encode_event(out, room, &d.event, h.t_ns, h.flags);
    case NATIVE_SURFACES:
        return encode_names(payload, h.length, h.t_ns, out, room);
    case NATIVE_EMITTER:
        return encode_emitter(payload, h.length, h.t_ns, out, room);
    case NATIVE_POSES:
        return encode_poses(payload, h.length, h.t_ns, out, room);
    default:
        fail_msg("type %d", h.type);
        return 0;
    }
}

static void test_frames(void **state)
{
    (void)state;
    static uint8_t stream[16384], again[8192];
    size_t len = 0, n;
    char *page = wire_read(page_path, NULL);
    for (int i = 0; (n = read_hex(page, i, stream + len, sizeof stream - len)) != 0; i++) {
        assert_int_equal(n, native_frame_len(stream + len));
        len += n;
    }
    int types = 0;
    struct sha256_ctx sha256;
    sha256_init(&sha256);
    for (size_t at = 0; at < len;) {
        const uint8_t *frame = stream + at;
        size_t size = encode_again(frame, frame + native_frame_len(frame), again, sizeof again);
        for (size_t i = 0; i < size; i += native_frame_len(again + i)) {
            struct native_header header;
            native_read_header(frame + i, &header);
            native_finish_frame(again + i, header.seq);
            types |= 1 << header.type;
            /* The hash includes, in COUNTS.md's words: u8 type, u32 length, payload; these are at 1 and 4. */
            if ((header.flags & 3) != 0 || header.type == 5 || header.type == 6 || header.type == 7) continue;
            sha256_update(&sha256, 1, frame + i + 1);
            sha256_update(&sha256, 4, frame + i + 4);
            sha256_update(&sha256, header.length, frame + i + NATIVE_HEADER_LEN);
        }
        assert_memory_equal(again, frame, size);
        at += size;
    }
    assert_int_equal(types, 0x1ffe); /* 1 to 12 */
    uint8_t digest[SHA256_DIGEST_SIZE];
    char hex[2 * SHA256_DIGEST_SIZE + 3] = "`";
    sha256_digest(&sha256, sizeof digest, digest);
    for (size_t i = 0; i < sizeof digest; i++)
        snprintf(hex + 1 + 2 * i, 4, "%02x`", digest[i]);
    assert_non_null(strstr(page, hex));
    free(page);
}

/* Runs python_client.py and returns its output; free() it. */
static char *ask_python(struct wire *wire, const char *what, const char *page, const char *stream)
{
    const char python[] = "/usr/bin/python3";
    const char *const args[] = {
        "tests/wire/python_client.py", "drivers/host/python", "plain", what, page, stream, NULL};
    wire_run_program(wire, python, args, 0);
    return wire_read(wire_path(wire, "out"), NULL);
}

/* The words below each frame are those of the Python client, and follow from the tables of PROTOCOL.md. */
static void test_words(void **state)
{
    struct wire *wire = *state;
    char stream[352];
    if (access("/usr/bin/python3", X_OK) != 0) {
        print_message("# /usr/bin/python3 is missing\n");
        skip();
    }
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "samples.shs"));
    char *said = ask_python(wire, "samples", page_path, stream), *page = wire_read(page_path, NULL);
    assert_int_equal(strncmp(said, "6 1 2 3 9 11 12 4 7 8 5 10 5 6 ", 31), 0);
    said[strcspn(said, "\n")] = 0;
    assert_non_null(strstr(page, said + 31));
    free(said);
    free(page);
    said = ask_python(wire, "tables", "drivers/protocol", stream);
    assert_string_equal(said, "6 1 2 3 9 11 12 4 5 10 5 6\n"); /* the client has no fields of names and poses */
    free(said);
}

/* ---- the session */

static char played[1 << 16];
static size_t played_len;

static void __attribute__((format(printf, 1, 2))) say(const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    int n = vsnprintf(played + played_len, sizeof played - played_len, fmt, ap);
    va_end(ap);
    assert_true(n >= 0 && (size_t)n < sizeof played - played_len);
    played_len += (size_t)n;
}

static void say_frame(struct scanhead *sh, const struct scanhead_frame *f)
{
    const char *repeat = f->flags & SCANHEAD_REPEAT ? ", REPEAT" : "";
    struct scanhead_line_end end;
    switch (f->type) {
    case SCANHEAD_DESCRIPTOR:
        say("  descriptor of scan %u%s\n", le_get32(f->payload + 260), repeat);
        break;
    case SCANHEAD_ANCHOR:
        say("  anchor of station %u%s\n", le_get32(f->payload + 8), repeat);
        break;
    case SCANHEAD_POINTS:
        say("  points of line %u: pulses %llu to %llu\n", f->scan_line, (unsigned long long)f->pulse0,
            (unsigned long long)f->pulse0 + f->n_pulses - 1);
        break;
    case SCANHEAD_LINE_END:
        assert_int_equal(scanhead_line_end(sh, f, &end), 0);
        say("  end of line %u: %u pulses, %u echoes, status %u\n", end.scan_line, end.n_fired, end.n_echoes,
            end.status);
        break;
    case SCANHEAD_TELEMETRY:
        say("  telemetry, state %u\n", le_get32(f->payload));
        break;
    case SCANHEAD_EVENT:
        say("  event %u: %llu, %llu, %llu\n", f->event, (unsigned long long)f->event_value[0],
            (unsigned long long)f->event_value[1], (unsigned long long)f->event_value[2]);
        break;
    case SCANHEAD_SURFACES:
        say("  surfaces from %u on: %u\n", le_get32(f->payload), le_get32(f->payload + 4));
        break;
    default:
        fail_msg("type %d", f->type);
    }
}

/* Sends the page's lines with `> `, and writes all down in the page's form. */
static void play(struct scanhead *sh, const char *session)
{
    struct scanhead_frame frame;
    for (const char *line = session; *line != '`'; line = strchr(line, '\n') + 1) {
        char command[256], reply[512];
        if (line[0] != '>') continue;
        snprintf(command, sizeof command, "%.*s", (int)strcspn(line, "\n") - 2, line + 2);
        say("> %s\n", command);
        snprintf(reply, sizeof reply, "%s", client_ask(sh, command));
        while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
            say_frame(sh, &frame);
        say("< %s\n", reply);
    }
}

static void test_session(void **state)
{
    struct wire *wire = *state;
    char *page = wire_read(page_path, NULL), folder[256], config[2048] = "";
    const char *yaml = find_line(page, "```yaml as build/session.yaml\n", 0), *scene, *end;
    const char *session = find_line(page, "```text\n> ", 0);
    assert_true(yaml != NULL && session != NULL);
    yaml = strchr(yaml, '\n') + 1;
    session = strchr(session, '\n') + 1;
    scene = strstr(yaml, "../config");
    end = strstr(yaml, "```");
    assert_true(scene != NULL && scene < end);
    assert_non_null(getcwd(folder, sizeof folder));
    snprintf(config, sizeof config, "%.*s%s%.*s", (int)(scene - yaml), yaml, folder, (int)(end - scene) - 2, scene + 2);
    struct head head = head_start(wire, wire_write_text(wire, "session.yaml", config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    play(sh, session);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    int same = strncmp(session, played, played_len) == 0 && session[played_len] == '`';
    for (char *line = strtok(played, "\n"); !same && line != NULL; line = strtok(NULL, "\n"))
        print_message("# %s\n", line); /* in the page's form: if the head is right, the page needs them */
    assert_true(same);
    free(page);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames),
        cmocka_unit_test_setup_teardown(test_words, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_session, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
