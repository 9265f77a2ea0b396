/* SPDX-License-Identifier: MIT */
/* One exit status for one kind of failure, with any command: the table of firmware_sim/app/README.md. */
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

enum { DONE = 0, FAILED = 1, WRONG = 2 };

/* @ is the folder; config.yaml in it is a good configuration. At the port, %d, nobody listens. */
static const struct {
    const char *line;
    int status;
} CASES[] = {
    {"list", DONE},
    {"check @config.yaml", DONE},
    {"plan @config.yaml --json", DONE},
    {"check --example", DONE},
    {"record @config.yaml -o @scan.ply -o @scan.shs --quiet", DONE},
    {"record @scan.shs -o @again.ply --quiet", DONE},
    {"report @config.yaml @scan.ply --tolerance-m 0.001", DONE},
    {"run @config.yaml --start --frames 1 --pace fast --quiet --journal @journal", DONE},
    {"run @config.yaml --start --frames 1 --pace fast --quiet --replay-journal @journal", DONE},
    {"init @room.obj -o @new.yaml", DONE},
    {"check @new.yaml --help --set", DONE},
    {"batch @config.yaml --list --sweep noise.seed=1,2", DONE},
    {"batch @config.yaml --sweep noise.seed=1:0:1 --list", WRONG},
    {"batch @config.yaml --sweep head.prr_hz=fast --list", WRONG},
    {"batch @none.yaml --list", WRONG},
    {"batch @faulty.yaml --list", WRONG},
    {"batch @config.yaml --fly", WRONG},
    {"batch @config.yaml -o @none/campaign", WRONG},

    /* the command line */
    {"", WRONG},
    {"fly", WRONG},
    {"--version", DONE},
    {"--version extra", WRONG},
    {"run @config.yaml --fly", WRONG},
    {"record @config.yaml -o @x.ply --fly", WRONG},
    {"plan @config.yaml --fly", WRONG},
    {"map @config.yaml -o @x.png --fly", WRONG},
    {"report @config.yaml @scan.ply --fly", WRONG},
    {"coverage @config.yaml --fly", WRONG},
    {"view @scan.ply --fly", WRONG},
    {"view @scan.ply --port 65536", WRONG},
    {"view @scan.ply --address 300.1.1.1", WRONG},
    {"check @config.yaml --fly", WRONG},
    {"list --fly", WRONG},
    {"init @room.obj --fly", WRONG},
    {"init", WRONG},
    {"run @config.yaml --duration 0", WRONG},
    {"record @config.yaml -o @x.ply --duration 0", WRONG},
    {"map @config.yaml -o @x.png --pixel-m 0", WRONG},
    {"report @config.yaml @scan.ply --max-m 0", WRONG},
    {"record @config.yaml -o @x.ending", WRONG},
    {"record here:there -o @x.ply", WRONG},

    /* the configuration: missing, no regular file, an error in it, an error in --set, a mesh that is missing */
    {"run @none.yaml", WRONG},
    {"record @none.yaml -o @x.ply", WRONG},
    {"plan @none.yaml", WRONG},
    {"map @none.yaml -o @x.png", WRONG},
    {"report @none.yaml @scan.ply", WRONG},
    {"coverage @none.yaml", WRONG},
    {"check @none.yaml", WRONG},
    {"run @fifo.yaml", WRONG},
    {"record @fifo.yaml -o @x.ply", WRONG},
    {"run @faulty.yaml", WRONG},
    {"record @faulty.yaml -o @x.ply", WRONG},
    {"plan @faulty.yaml", WRONG},
    {"map @faulty.yaml -o @x.png", WRONG},
    {"report @faulty.yaml @scan.ply", WRONG},
    {"check @faulty.yaml", WRONG},
    {"run @config.yaml --set head.prr_hz=fast", WRONG},
    {"record @config.yaml -o @x.ply --set head.prr_hz=fast", WRONG},
    {"plan @config.yaml --set scene.meshes[0].file=none.obj", WRONG},
    {"map @config.yaml -o @x.png --set scene.meshes[0].file=none.obj", WRONG},
    {"check @config.yaml --set links[0].address=300.1.1.1", WRONG},
    {"run @config.yaml --set links[0].address=300.1.1.1", WRONG},
    {"check @config.yaml --set head.settings_file=@none/x", WRONG},
    {"run @config.yaml --set head.settings_file=@none/x", WRONG},
    {"check @config.yaml --set head.settings_file=@stored", WRONG},
    {"run @config.yaml --set head.settings_file=@stored", WRONG},

    /* input files: missing, or of another kind */
    {"init @none.obj", WRONG},
    {"init @fifo.obj", WRONG},
    {"report @config.yaml @none.ply", WRONG},
    {"report @config.yaml @faulty.yaml", WRONG},
    {"view @none.ply", WRONG},
    {"view @none.shs", WRONG},
    {"view @fifo.shs", WRONG},
    {"view @faulty.yaml", WRONG},
    {"record @none.shs -o @x.ply", WRONG},
    {"record @fifo.shs -o @x.ply", WRONG},
    {"run @none.shs --link null --start", WRONG},
    {"run @none.pcap", WRONG},
    {"run @scan.shs --link null", WRONG}, /* nobody could begin it */
    {"run @empty.shs --start --link null", WRONG},
    {"run @junk.shs --start --link null", WRONG},
    {"run @empty.pcap", WRONG},
    {"run @junk.pcap", WRONG},
    {"run @empty.pcapng", WRONG},
    {"run @junk.pcapng", WRONG},
    {"record @empty.shs -o @x.ply", WRONG},
    {"record @junk.shs -o @x.ply", WRONG},
    {"record @junk.pcapng -o @x.ply", WRONG},
    {"record --repair @empty.shs", WRONG},
    {"record --repair @junk.shs", WRONG},
    {"record --repair @junk.pcapng", WRONG},
    {"record --repair @junk.ply", WRONG},
    {"record --repair @none.shs", WRONG},
    {"view @empty.shs", WRONG},
    {"view @junk.shs", WRONG},
    {"view @junk.pcapng", WRONG},
    {"view @junk.ply", WRONG},
    {"report @config.yaml @junk.ply", WRONG},
    {"report @config.yaml @junk.las", WRONG},
    {"map @config.yaml -o @x.png --cloud @junk.ply", WRONG},
    {"run @config.yaml --replay-journal @none", WRONG},
    {"run @config.yaml --replay-journal @scan.shs", WRONG},
    {"run @config.yaml --set platform.kind=trajectory --set platform.file=@none.csv", WRONG},
    {"check @config.yaml --set platform.kind=trajectory --set platform.file=@faulty.yaml", WRONG},

    /* files to write whose path is wrong */
    {"record @config.yaml -o @none/x.ply", WRONG},
    {"record @config.yaml -o @x.ply --quiet --stats @none/x", WRONG},
    {"map @config.yaml -o @none/x.png", WRONG},
    {"coverage @config.yaml -o @none/x.ply", WRONG},
    {"init @room.obj -o @none/x.yaml", WRONG},
    {"run @config.yaml --duration 0.01 --pace fast --quiet --stats @none/x", WRONG},
    {"run @config.yaml --duration 0.01 --pace fast --quiet --journal @none/x", WRONG},

    /* a head that is missing; a request without an answer */
    {"record tcp:127.0.0.1:%d -o @x.ply", FAILED},
    {"record tty:@none -o @x.ply", FAILED},
    {"record usb:ffff:ffff -o @x.ply", FAILED},
    {"record @cut.shs -o @x.ply --quiet", FAILED},
    {"report @config.yaml @scan.ply --tolerance-m 1e-12", FAILED},
};

static const char *const BROKEN[] = {"empty.shs", "empty.pcap",  "empty.pcapng", "junk.shs",
                                     "junk.pcap", "junk.pcapng", "junk.ply",     "junk.las"};

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
    for (size_t i = 0; i < sizeof BROKEN / sizeof BROKEN[0]; i++)
        wire_write_text(wire, BROKEN[i], strncmp(BROKEN[i], "empty", 5) == 0 ? "" : "neither stream nor cloud\n");
    /* HEAD:FOO is no command of the head */
    wire_write_text(wire, "stored", "scanhead settings 1\nprofile full-sweep\nhead HEAD:FOO 1\nend\n");
    assert_int_equal(mkfifo(wire_path(wire, "fifo.yaml"), 0600), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo.shs"), 0600), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo.obj"), 0600), 0);
}

static void test_every_command(void **state)
{
    struct wire *wire = *state;
    int wrong = 0, port;
    const int fd = wire_bind(SOCK_STREAM, &port);
    write_files(wire);
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        if (strstr(CASES[i].line, "cut.shs") != NULL) cut_stream(wire);
        char line[200];
        snprintf(line, sizeof line, CASES[i].line, port);
        const int status = wire_wait(wire, wire_spawn(wire, usage_words(wire, line), "out", "err", -1));
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
