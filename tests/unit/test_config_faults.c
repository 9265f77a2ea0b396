/* SPDX-License-Identifier: MIT */
/* All errors of a configuration at once, in their order, without those that only follow from another one. And files
 * that are no configuration. */
#include "firmware_sim/config/load.h"
#include "tests/common/free_fd.h"
#include "tests/unit/config_rig.h"

/* The errors are these, in this order. Each begins with PATH:LINE: KEY, or with the text here. */
static void assert_faults(const char *const *starts, uint32_t n)
{
    char want[256];
    for (uint32_t i = 0; i < n || i < diagnostics.n; i++) {
        const char *got = i < diagnostics.n ? diagnostics.err[i].text : "nothing";
        const int of_file = i < n && starts[i][0] >= '0' && starts[i][0] <= '9';
        snprintf(want, sizeof want, "%s%s%s", of_file ? config_path : "", of_file ? ":" : "",
                 i < n ? starts[i] : "nothing");
        if (strncmp(got, want, strlen(want)) != 0) fail_msg("fault %u is \"%s\", expected \"%s\"", i, got, want);
    }
}
#define ASSERT_FAULTS(...) \
    assert_faults((const char *const[]){__VA_ARGS__}, sizeof((const char *const[]){__VA_ARGS__}) / sizeof(const char *))

static void all_faults_are_told_in_order(void **state)
{
    (void)state;
    static const char text[] = "head: {profile: any-rate, prr_hz: 30 kHz,\n" /* 1 */
                               "       lines_hz: 500, serial: a;b, colour: red}\n"
                               "scene: {meshes: [{file: cube.obj, up: x}]}\n" /* 3 */
                               "stations:\n"
                               "  - {position_m: [0, 0], heading_deg: 400}\n"
                               "links: [{type: pty, port: 1, address: a}]\n" /* 6 */
                               "output: {crs: local, heights: geoid, utm_zone: 7}\n"
                               "loop: {tick_hz: 999}\n"; /* 8 */
    const char *const sets[] = {"head.frames=-1", "gnss.quality=3"};
    write_file(config_path, text, sizeof text - 1);
    assert_int_equal(load_sets(sets, 2), SH_EINPUT);
    ASSERT_FAULTS("1: head.prr_hz: ", "2: head.serial: ", "2: head.colour: ", "2: head.lines_hz: ",
                  "3: scene.meshes[0].up: ", "3: scene.meshes[0].scale: missing", "5: stations[0].position_m: ",
                  "5: stations[0].heading_deg: ", "6: links[0].address: ", "6: links[0].port: ", "7: output.utm_zone: ",
                  "7: output.heights: ", "8: loop.tick_hz: ", "--set head.frames: ", "--set gnss.quality: ");
    /* The shorter call returns the first. */
    struct sh_err first;
    assert_int_equal(config_load(config_path, sets, 2, cfg, &first), SH_EINPUT);
    assert_string_equal(first.text, diagnostics.err[0].text);
}

static void what_follows_from_a_fault_is_not_told(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with, *fault;
    } one[] = {
        {"scale: 1", "scal: 1", "9: scene.meshes[0].scal: unknown key, did you mean scene.meshes[0].scale?"},
        {"scene:", "scen:", "5: scen: unknown key, did you mean scene?"},
        {"stations:", "station:", "10: station: unknown key, did you mean stations?"},
        {"position_m", "positon_m", "11: stations[0].positon_m: unknown key"},
        {"  - position_m: [1, 2, 3]\n    heading_deg: 90\n", "  gate\n", "11: stations: here stands a single value"},
        {"type: tcp", "type: tpc", "14: links[0].type: "}, /* an unknown type may have a port */
        {"    port: 0\n", "    port: 0\n  - {type: tcp, port: 0, protocol: colla}\nntp: {role: client}\n",
         "16: links[1].protocol: "}, /* an unknown protocol may send dates */
        {"    port: 0\n", "    port: 0\n  - {type: tcp, port: 0, protocol: colla}\nfaults: [{kind: window_soiled}]\n",
         "16: links[1].protocol: "},
        {"any-rate", "riegl", "2: head.profile: "},                           /* its limits are not known */
        {LINES, "  lines_hz: 1e6\n", "4: head.lines_hz: 1000000 is outside"}, /* more than prr_hz */
        {LINES, "  line_start_deg: 99\n  line_stop_deg: 5\n", "4: head.line_start_deg: 99 is outside"},
        {"output:", "noise: {range: signal}\nsignal: {model: loud}\noutput:", "17: signal.model: "},
        {"output:", "platform: {kind: car, file: a}\noutput:", "16: platform.kind: "},
        {"output:", "surfaces: [{glass: 0.8, reflectance: 7}]\noutput:", "16: surfaces[0].reflectance: "},
    };
    for (size_t i = 0; i < sizeof one / sizeof one[0]; i++) {
        assert_int_equal(load_edited(one[i].old, one[i].with), SH_EINPUT);
        ASSERT_FAULTS(one[i].fault);
    }
}

static void faults_of_the_profile_come_last(void **state)
{
    (void)state;
    char *text = read_source("config/heads/leica-rtc360.yaml"), name[160];
    memcpy(strstr(text, "value: 130,"), "value: a30,", 11);
    memcpy(strstr(text, "value: 0.5,"), "value: b.5,", 11);
    write_in("heads/mine.yaml", text);
    free(text);
    snprintf(name, sizeof name, "%s/heads/mine.yaml:", dir);
    assert_int_equal(load_edited("any-rate\n  prr_hz: 500000\n  lines_hz: 100", "mine\n  frames: x"), SH_EINPUT);
    ASSERT_FAULTS("3: head.frames: ", name, name);
    /* Errors of --set stand between those of the file and those of its profile. */
    const char *const sets[] = {"gnss.quality=3", "links.0.port=x"};
    assert_int_equal(load_sets(sets, 2), SH_EINPUT);
    ASSERT_FAULTS("3: head.frames: ", "--set links[0].port: ", "--set gnss.quality: ", name, name);
}

static void twenty_are_kept_and_all_are_counted(void **state)
{
    (void)state;
    char text[4096], want[32];
    int n = snprintf(text, sizeof text, "%s\nsurfaces:\n", base);
    for (int i = 0; i < 60; i++)
        n += snprintf(text + n, sizeof text - (size_t)n, "  - {retro: -1}\n");
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_int_equal(diagnostics.n, 60);
    snprintf(want, sizeof want, "surfaces[%d]", CONFIG_MAX_DIAGNOSTICS - 1);
    assert_non_null(strstr(diagnostics.err[CONFIG_MAX_DIAGNOSTICS - 1].text, want));
    /* An error that is found later and stands before the others takes its place before them. */
    char *first = strstr(text, "  prr_hz: 500000");
    memcpy(first, "  prr_hz: 999999", 16);
    memcpy(strstr(text, "lines_hz: 100"), "lines_hz: 2  ", 13); /* outside the profile: found after reading */
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_int_equal(diagnostics.n, 61);
    assert_non_null(strstr(diagnostics.err[0].text, ":4: head.lines_hz: 2 is outside"));
}

/* A hostile file: thousands of errors cost as much as reading. The only assertion on time is that it ends. */
static void many_faults_end(void **state)
{
    (void)state;
    enum { LINES_OF_IT = 100000 };
    char *text = malloc(LINES_OF_IT * 10 + 1), *at = text;
    assert_non_null(text);
    for (int i = 0; i < LINES_OF_IT; i++)
        at += sprintf(at, "k%05d: 1\n", i);
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_true(diagnostics.n >= LINES_OF_IT);
    free(text);
}

/* ---- a FIFO or a device is refused at once: opening it could wait, or reading it never end */

static void a_fifo_or_a_device_is_refused(void **state)
{
    (void)state;
    char fifo[128], fifo_obj[128];
    snprintf(fifo, sizeof fifo, "%s/fifo.yaml", dir);
    snprintf(fifo_obj, sizeof fifo_obj, "%s/fifo.obj", dir);
    assert_int_equal(mkfifo(fifo, 0600), 0);
    assert_int_equal(mkfifo(fifo_obj, 0600), 0);
    assert_int_equal(config_load(fifo, NULL, 0, cfg, &err), SH_EINPUT);
    assert_says("fifo.yaml: cannot be opened: a FIFO, not a file; a YAML file is needed");
    assert_int_equal(config_load("/dev/zero", NULL, 0, cfg, &err), SH_EINPUT);
    assert_says("/dev/zero: cannot be opened: a device, not a file");
    assert_int_equal(load_edited("cube.obj", "fifo.obj"), SH_EINPUT);
    assert_says("fifo.obj: a FIFO, not a file; allowed a mesh file that can be read");
    assert_int_equal(load_edited("any-rate", "fifo.yaml"), SH_EINPUT);
    assert_says("fifo.yaml: cannot be opened: a FIFO, not a file");
    remove(fifo);
    remove(fifo_obj);
}

/* The memory of this process can be opened as a file, and has nothing at its beginning that could be read. */
static void a_file_that_cannot_be_read_is_refused(void **state)
{
    (void)state;
    assert_int_equal(config_load("/proc/self/mem", NULL, 0, cfg, &err), SH_EINPUT);
    assert_string_equal(err.text, "/proc/self/mem: cannot be read: Input/output error; a YAML file is needed");
}

static void no_file_stays_open(void **state)
{
    (void)state;
    struct fault fault;
    struct config_profile profile;
    const int before = free_fd();
    write_in("test.yaml", "faults: [{kind: drop}]\n");
    assert_int_equal(config_load(config_path, NULL, 0, cfg, &err), SH_EINPUT);
    assert_int_equal(config_add_scenario(cfg, config_path, &diagnostics), SH_OK);
    write_in("test.yaml", "faults: [{kind: x}]\n");
    assert_int_equal(config_add_scenario(cfg, config_path, &diagnostics), SH_EINPUT);
    assert_loads(load_edited("      up: z\n", "      up: z\n      copies: cube.obj\n"));
    assert_int_equal(config_read_fault(cfg, "{kind: drop}", &fault, &err), SH_OK);
    assert_int_equal(load_edited("any-rate", "cube.obj"), SH_EINPUT);
    assert_int_equal(load_edited("cube.obj", "dir.obj"), SH_EINPUT);
    assert_int_equal(load_changed("leica-rtc360", "max_echoes: { value: 1,", "max_echoes: { value: x,"), SH_EINPUT);
    assert_int_equal(config_load_profile("any-rate", NULL, &profile, &err), SH_OK);
    assert_int_equal(free_fd(), before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_faults_are_told_in_order),
        cmocka_unit_test(what_follows_from_a_fault_is_not_told),
        cmocka_unit_test(faults_of_the_profile_come_last),
        cmocka_unit_test(twenty_are_kept_and_all_are_counted),
        cmocka_unit_test(many_faults_end),
        cmocka_unit_test(a_fifo_or_a_device_is_refused),
        cmocka_unit_test(a_file_that_cannot_be_read_is_refused),
        cmocka_unit_test(no_file_stays_open),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
