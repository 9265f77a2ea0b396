/* SPDX-License-Identifier: MIT */
/* A text of one character, and the longest, is as much a text as any other. Paths in --set stay as they are. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

enum { MOST_SETS = 5 };

/* Loads base with these --set. */
static int load_these(const char *const sets[MOST_SETS])
{
    int n = 0;
    while (n < MOST_SETS && sets[n] != NULL)
        n++;
    write_file(config_path, base, strlen(base));
    return load_sets(sets, n);
}

static void one_character_is_a_text(void **state)
{
    (void)state;
    static const struct {
        const char *sets[MOST_SETS];
        const char *says; /* after "--set "; NULL: it loads */
    } cases[] = {
        {{"platform.kind=trajectory", "platform.file=a"}, NULL},
        {{"platform.kind=trajectory", "platform.waypoints=a"}, NULL},
        {{"platform.kind=trajectory", "platform.file=a", "platform.waypoints=b"},
         "platform.waypoints: a trajectory comes from one file; allowed either platform.file or platform.waypoints"},
        {{"platform.file=a", "platform.kind=stops", "platform.step_s=1"}, NULL},
        {{"platform.waypoints=a", "platform.kind=stops", "platform.step_s=1"}, NULL},
        {{"links.0={type: file, path: f}"}, NULL},
        {{"links.0={type: file, path: f}", "links.1.type=file", "links.1.path=f"},
         "links[1].path: links[0] has the same path; allowed a path of its own"},
        {{"links.0={type: tcp, port: 5}", "links.1.type=tcp", "links.1.address=a", "links.1.port=5"}, NULL},
        {{"links.0={type: tcp, port: 5, address: a}", "links.1.type=tcp", "links.1.address=a", "links.1.port=5"},
         "links[1].port: links[0] listens on the same port; allowed a port of its own, or 0"},
        {{"waveform.pulse=table", "waveform.pulse_file=p"}, NULL},
        {{"waveform.pulse=gaussian", "waveform.pulse_file=p"},
         "waveform.pulse_file: a file, but waveform.pulse is gaussian; allowed with pulse: table"},
        {{"scene.meshes.0.copies=c"},
         "scene.meshes[0].copies: c: No such file or directory; allowed a CSV file that can be read"},
        {{"scene.target.objects=[a]", "scene.target.others=hide"}, NULL},
        {{"scene.meshes.0.file=m"},
         "scene.meshes[0].file: \"m\" has no known ending; allowed .obj .ply .stl .gltf .glb .fbx .dae .ifc .tif .tiff"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char want[400];
        const int code = load_these(cases[i].sets);
        if (cases[i].says == NULL) {
            assert_loads(code);
            continue;
        }
        snprintf(want, sizeof want, "--set %s", cases[i].says);
        assert_string_equal(err.text, want);
        assert_int_equal(diagnostics.n, 1);
    }
}

static void names_and_numbers_of_one_character_are_kept(void **state)
{
    (void)state;
    static const char *const sets[MOST_SETS] = {"stations.0.name=n", "head.serial=s", "links.0={type: usb, serial: u}",
                                                "links.1.type=usb", "head.name=h"};
    assert_loads(load_these(sets));
    assert_string_equal(cfg->station[0].name, "n");
    assert_string_equal(cfg->head.serial, "s");
    assert_string_equal(cfg->head.name, "h");
    assert_string_equal(cfg->link[0].serial, "u");
    assert_string_equal(cfg->link[1].serial, "s");
    assert_int_equal(cfg->link[0].own_serial, 0);
    assert_int_equal(cfg->link[1].own_serial, 0);
    assert_string_equal(cfg->link[0].whose, ""); /* its serial is its own */
}

/* An empty value takes back a text that is empty by default: the key counts as not given. Others keep their text. */
static void an_empty_text_is_not_given(void **state)
{
    (void)state;
    static const struct {
        const char *sets[MOST_SETS];
        const char *says; /* after "--set "; NULL: it loads */
    } cases[] = {
        {{"head.settings_file=f", "head.name=n", "head.settings_file=", "head.name="}, NULL},
        {{"head.settings_file="}, NULL},
        {{"waveform.pulse=gaussian", "waveform.pulse_file=p", "waveform.pulse_file="}, NULL},
        {{"stations.0.scanner.head.name=n", "stations.0.scanner.head.name="}, NULL},
        {{"head.serial="},
         "head.serial: \"\" is empty; allowed text of 1 to 31 bytes, printable ASCII without comma, "
         "';' and quotes"},
        {{"scene.target.objects=[a]", "scene.target.objects.0="}, "scene.target.objects[0]: \"\" is empty; "},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char want[400];
        const int code = load_these(cases[i].sets);
        if (cases[i].says == NULL) {
            assert_loads(code);
            assert_string_equal(cfg->head.settings_file, "");
            assert_string_equal(cfg->head.name, "");
            continue;
        }
        snprintf(want, sizeof want, "--set %s", cases[i].says);
        if (code != SH_EINPUT || strncmp(err.text, want, strlen(want)) != 0) fail_msg("%zu: %s", i, err.text);
    }
}

/* A text may have as many bytes as the error says, and no more. A path of a file counts with its folder. */
static void the_longest_texts(void **state)
{
    (void)state;
    static const struct {
        const char *key;
        size_t most;
    } keys[] = {{"stations.0.name", 31}, {"head.serial", 31},     {"head.name", 31},
                {"time.epoch", 39},      {"links.0.address", 63}, {"head.settings_file", CONFIG_PATH_LEN - 1}};
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        for (size_t more = 0; more <= 1; more++) {
            char set[CONFIG_PATH_LEN + 64], allowed[64];
            const int n = snprintf(set, sizeof set, "%s=", keys[i].key);
            memset(set + n, 'x', keys[i].most + more);
            set[(size_t)n + keys[i].most + more] = '\0';
            const char *const sets[MOST_SETS] = {set};
            const int code = load_these(sets);
            const int is_epoch = strcmp(keys[i].key, "time.epoch") == 0;
            if (more == 0 && !is_epoch) assert_loads(code);
            if (more == 0) continue;
            snprintf(allowed, sizeof allowed, " of 1 to %zu bytes", keys[i].most);
            assert_says(is_epoch ? "\" is too long; " : allowed);
            assert_says("\" is too long; allowed ");
        }
    char text[2 * CONFIG_PATH_LEN], path[CONFIG_PATH_LEN + 1];
    const size_t room = CONFIG_PATH_LEN - 1 - (strlen(dir) + 1);
    for (size_t more = 0; more <= 1; more++) {
        memset(path, 'y', sizeof path);
        path[room + more] = '\0';
        snprintf(text, sizeof text, "  prr_hz: 500000\n  settings_file: %s\n", path);
        const int code = load_edited(PRR, text);
        if (more == 0) {
            assert_loads(code);
            assert_int_equal(strlen(cfg->head.settings_file), CONFIG_PATH_LEN - 1);
        } else {
            assert_int_equal(code, SH_EINPUT);
            assert_says("...\" is too long with the folder of its file; allowed a path of 1 to 511 bytes");
        }
    }
}

/* The path of the configuration itself, /////...z, has up to 511 bytes. */
static void the_longest_path_of_a_configuration(void **state)
{
    (void)state;
    char path[CONFIG_PATH_LEN + 1], want[200];
    memset(path, '/', sizeof path);
    strcpy(path + CONFIG_PATH_LEN - 2, "z");
    assert_int_equal(config_load_all(path, NULL, 0, cfg, &diagnostics), SH_EINPUT);
    assert_non_null(strstr(diagnostics.err[0].text, ": cannot be opened: No such file or directory"));
    path[CONFIG_PATH_LEN - 2] = '/';
    strcpy(path + CONFIG_PATH_LEN - 1, "z");
    assert_int_equal(config_load_all(path, NULL, 0, cfg, &diagnostics), SH_EINPUT);
    assert_int_equal(diagnostics.n, 1);
    snprintf(want, sizeof want, "%.100s...: path too long; allowed up to 511 bytes", path);
    assert_string_equal(diagnostics.err[0].text, want);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_character_is_a_text),
        cmocka_unit_test(names_and_numbers_of_one_character_are_kept),
        cmocka_unit_test(an_empty_text_is_not_given),
        cmocka_unit_test(the_longest_texts),
        cmocka_unit_test(the_longest_path_of_a_configuration),
    };
    return cmocka_run_group_tests_name("texts", tests, set_up, tear_down);
}
