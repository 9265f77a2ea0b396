/* SPDX-License-Identifier: MIT */
/* One exit status for one kind of failure, with any command: the table of firmware_sim/app/README.md. */
#include "tests/wire/room.h"

enum { DONE = 0, FAILED = 1, WRONG = 2, MAX_WORDS = 12 };

/* CONFIG is a good configuration, DIR the folder, and NOBODY an address where nobody listens. Words are separated by
 * blanks. */
static const struct {
    const char *line;
    int status;
} CASES[] = {
    {"list", DONE},
    {"check CONFIG", DONE},
    {"plan CONFIG --json", DONE},
    {"check --example", DONE},
    {"record CONFIG -o DIR/scan.ply -o DIR/scan.shs --quiet", DONE},
    {"record DIR/scan.shs -o DIR/again.ply --quiet", DONE},
    {"report CONFIG DIR/scan.ply --tolerance-m 0.001", DONE},
    {"run CONFIG --start --frames 1 --pace fast --quiet --journal DIR/journal", DONE},
    {"run CONFIG --start --frames 1 --pace fast --quiet --replay-journal DIR/journal", DONE},
    {"init DIR/room.obj -o DIR/new.yaml", DONE},
    {"check DIR/new.yaml --help --set", DONE},
    {"batch CONFIG --list --sweep noise.seed=1,2", DONE},
    {"batch CONFIG --sweep noise.seed=1:0:1 --list", WRONG},
    {"batch CONFIG --sweep head.prr_hz=fast --list", WRONG},
    {"batch DIR/none.yaml --list", WRONG},
    {"batch DIR/faulty.yaml --list", WRONG},
    {"batch CONFIG --fly", WRONG},
    {"batch CONFIG -o DIR/none/campaign", WRONG},

    /* the command line */
    {"", WRONG},
    {"fly", WRONG},
    {"run CONFIG --fly", WRONG},
    {"record CONFIG -o DIR/x.ply --fly", WRONG},
    {"plan CONFIG --fly", WRONG},
    {"map CONFIG -o DIR/x.png --fly", WRONG},
    {"report CONFIG DIR/scan.ply --fly", WRONG},
    {"coverage CONFIG --fly", WRONG},
    {"view DIR/scan.ply --fly", WRONG},
    {"view DIR/scan.ply --port 65536", WRONG},
    {"view DIR/scan.ply --address 300.1.1.1", WRONG},
    {"check CONFIG --fly", WRONG},
    {"list --fly", WRONG},
    {"init DIR/room.obj --fly", WRONG},
    {"init", WRONG},
    {"run CONFIG --duration 0", WRONG},
    {"record CONFIG -o DIR/x.ply --duration 0", WRONG},
    {"map CONFIG -o DIR/x.png --pixel-m 0", WRONG},
    {"report CONFIG DIR/scan.ply --max-m 0", WRONG},
    {"record CONFIG -o DIR/x.ending", WRONG},
    {"record here:there -o DIR/x.ply", WRONG},

    /* the configuration: missing, no regular file, an error in it, an error in --set, a mesh that is missing */
    {"run DIR/none.yaml", WRONG},
    {"record DIR/none.yaml -o DIR/x.ply", WRONG},
    {"plan DIR/none.yaml", WRONG},
    {"map DIR/none.yaml -o DIR/x.png", WRONG},
    {"report DIR/none.yaml DIR/scan.ply", WRONG},
    {"coverage DIR/none.yaml", WRONG},
    {"check DIR/none.yaml", WRONG},
    {"run DIR/fifo.yaml", WRONG},
    {"record DIR/fifo.yaml -o DIR/x.ply", WRONG},
    {"run DIR/faulty.yaml", WRONG},
    {"record DIR/faulty.yaml -o DIR/x.ply", WRONG},
    {"plan DIR/faulty.yaml", WRONG},
    {"map DIR/faulty.yaml -o DIR/x.png", WRONG},
    {"report DIR/faulty.yaml DIR/scan.ply", WRONG},
    {"check DIR/faulty.yaml", WRONG},
    {"run CONFIG --set head.prr_hz=fast", WRONG},
    {"record CONFIG -o DIR/x.ply --set head.prr_hz=fast", WRONG},
    {"plan CONFIG --set scene.meshes[0].file=none.obj", WRONG},
    {"map CONFIG -o DIR/x.png --set scene.meshes[0].file=none.obj", WRONG},
    {"check CONFIG --set links[0].address=300.1.1.1", WRONG},
    {"run CONFIG --set links[0].address=300.1.1.1", WRONG},

    /* input files: missing, or of another kind */
    {"init DIR/none.obj", WRONG},
    {"init DIR/fifo.obj", WRONG},
    {"report CONFIG DIR/none.ply", WRONG},
    {"report CONFIG DIR/faulty.yaml", WRONG},
    {"view DIR/none.ply", WRONG},
    {"view DIR/none.shs", WRONG},
    {"view DIR/fifo.shs", WRONG},
    {"view DIR/faulty.yaml", WRONG},
    {"record DIR/none.shs -o DIR/x.ply", WRONG},
    {"record DIR/fifo.shs -o DIR/x.ply", WRONG},
    {"run CONFIG --replay-journal DIR/none", WRONG},
    {"run CONFIG --replay-journal DIR/scan.shs", WRONG},
    {"run CONFIG --set platform.kind=trajectory --set platform.file=DIR/none.csv", WRONG},
    {"check CONFIG --set platform.kind=trajectory --set platform.file=DIR/faulty.yaml", WRONG},

    /* files to write whose path is wrong */
    {"record CONFIG -o DIR/none/x.ply", WRONG},
    {"record CONFIG -o DIR/x.ply --quiet --stats DIR/none/x", WRONG},
    {"map CONFIG -o DIR/none/x.png", WRONG},
    {"coverage CONFIG -o DIR/none/x.ply", WRONG},
    {"init DIR/room.obj -o DIR/none/x.yaml", WRONG},
    {"run CONFIG --duration 0.01 --pace fast --quiet --stats DIR/none/x", WRONG},
    {"run CONFIG --duration 0.01 --pace fast --quiet --journal DIR/none/x", WRONG},

    /* a head that is missing; a request without an answer */
    {"record tcp:NOBODY -o DIR/x.ply", FAILED},
    {"record tty:DIR/none -o DIR/x.ply", FAILED},
    {"record usb:ffff:ffff -o DIR/x.ply", FAILED},
    {"record DIR/cut.shs -o DIR/x.ply --quiet", FAILED},
    {"report CONFIG DIR/scan.ply --tolerance-m 1e-12", FAILED},
};

/* The word with its names replaced. */
static void fill_in(const struct wire *wire, const char *nobody, const char *word, size_t n, char *buf, size_t len)
{
    char text[128];
    snprintf(text, sizeof text, "%.*s", (int)n, word);
    const char *dir = strstr(text, "DIR"), *peer = strstr(text, "NOBODY");
    if (strcmp(text, "CONFIG") == 0)
        snprintf(buf, len, "%s", wire_path(wire, "config.yaml"));
    else if (dir != NULL)
        snprintf(buf, len, "%.*s%s%s", (int)(dir - text), text, wire->dir, dir + 3);
    else if (peer != NULL)
        snprintf(buf, len, "%.*s%s", (int)(peer - text), text, nobody);
    else
        snprintf(buf, len, "%s", text);
}

static int run(struct wire *wire, const char *line, const char *nobody)
{
    char word[MAX_WORDS][352];
    const char *args[MAX_WORDS + 1] = {0};
    int n = 0;
    for (const char *at = line; *at != '\0'; at += strspn(at, " ")) {
        const size_t len = strcspn(at, " ");
        fill_in(wire, nobody, at, len, word[n], sizeof word[n]);
        args[n] = word[n];
        n++;
        at += len;
    }
    return wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
}

/* Writes the first half of a recorded stream. */
static void cut_stream(const struct wire *wire)
{
    size_t len;
    char *stream = wire_read(wire_path(wire, "scan.shs"), &len);
    wire_write(wire, "cut.shs", stream, len / 2);
    free(stream);
}

static void write_files(const struct wire *wire)
{
    room_write(wire);
    room_config_write(wire, &(struct room_config){.prr_hz = 20000,
                                                  .lines_hz = 50,
                                                  .pan_deg_s = 360,
                                                  .pan_stop_deg = 360,
                                                  .frames = 1,
                                                  .links = LINK_YAML_TCP});
    wire_write_text(wire, "faulty.yaml", "head: {profile: full-sweep, frames: -1}\n");
    assert_int_equal(mkfifo(wire_path(wire, "fifo.yaml"), 0600), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo.shs"), 0600), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo.obj"), 0600), 0);
}

static void test_every_command(void **state)
{
    struct wire *wire = *state;
    char nobody[32];
    int wrong = 0, port, fd = wire_bind(SOCK_STREAM, &port);
    snprintf(nobody, sizeof nobody, "127.0.0.1:%d", port);
    write_files(wire);
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        if (strstr(CASES[i].line, "cut.shs") != NULL) cut_stream(wire);
        const int status = run(wire, CASES[i].line, nobody);
        if (status == CASES[i].status) continue;
        char *err = wire_read(wire_path(wire, "err"), NULL);
        print_message("# scanhead %s: status %d, not %d: %s", CASES[i].line, status, CASES[i].status, err);
        free(err);
        wrong++;
    }
    close(fd);
    assert_int_equal(wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_every_command, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
