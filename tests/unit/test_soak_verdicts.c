/* SPDX-License-Identifier: MIT */
/* soak --client, without a head and a client: what its options become, which scenarios are run, what is written of
 * them, and each wrong use. The run of a verdict is the test's. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware_sim/app/studio/verdict/verdict.h"
#include "firmware_sim/config/config.h"
#include "tests/unit/trace_rig.h"

extern const struct app_command app_soak;

static int n_runs, fails_at, fails_with; /* the run of that number, from 1; 0: none */
static uint32_t found_in;                /* runs that have a finding: bit per number */

void verdict_be_patient(struct config *cfg)
{
    (void)cfg;
}

static const char *or_none(const char *text)
{
    return text != NULL ? text : "none";
}

/* All checks pass but two: the first is not judged, and the last has a finding in the runs of found_in. */
int verdict_run(struct config *cfg, const struct verdict_options *o, struct verdict *v, struct sh_err *err)
{
    n_runs++;
    say("%s: %s, file %s, folder %s, truth %s, %g s, %g s, %g s, %g m, link %u, "
        "allowed %x, %u faults\n",
        v->scenario, o->command, or_none(o->file), or_none(o->folder), or_none(o->truth), o->duration_s, o->limit_s,
        o->grace_s, o->match_m, o->link, o->allowed, cfg->faults.n);
    if (n_runs == fails_at) return sh_fail(err, fails_with, "the run failed");
    for (int i = 1; i < VERDICT_N_CHECKS; i++)
        v->check[i].state = VERDICT_PASSED;
    if ((found_in >> n_runs & 1) != 0) v->check[VERDICT_N_CHECKS - 1].state = VERDICT_FOUND;
    v->figures.wall_s = n_runs;
    return SH_OK;
}

static void begin(void)
{
    trace[0] = '\0';
    n_runs = fails_at = 0;
    found_in = 0;
}

static void soak_does(const char *words, int status)
{
    begin();
    does(&app_soak, words, status);
}

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    setenv("TMPDIR", ".", 1);
    write_text(
        "c.yaml",
        "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: r.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, "
        "0, 1]}]\noutput: {crs: local}\nlinks: [{type: tcp}, {type: pty}, {type: 'null'}, {type: "
        "file, path: x.shs}, {type: web}]\n");
    write_text("r.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_text("a.yaml", "faults: [{kind: drop, at: 5}]\n");
    write_text("b.c.yaml", "faults: [{kind: drop, at: 5}, {kind: drop, at: 7}]\n");
    return 0;
}

static void defaults(void **state)
{
    char expected[256], *folder;
    struct stat is;
    (void)state;
    soak_does("c.yaml --client run", 0);
    assert_string_equal(on_err, "");
    folder = strstr(trace, "./scanhead-soak-");
    assert_non_null(folder);
    folder = strndup(folder, strlen("./scanhead-soak-XXXXXX"));
    snprintf(expected, sizeof expected,
             "configuration: run, file none, folder %s, truth none, 30 s, 10 s, 5 s, -0.001 m, "
             "link 1, allowed 0, 0 faults\n",
             folder);
    assert_string_equal(trace, expected);
    assert_true(stat(folder, &is) == 0 && S_ISDIR(is.st_mode));
    free(folder);
    has(on_out, "configuration: 1.0 s, ");
    has(on_out, "findings: 0, of 10 checks in 1 scenario\n");
    setenv("TMPDIR", "", 1);
    soak_does("c.yaml --client run", 0);
    setenv("TMPDIR", ".", 1);
    folder = strstr(trace, "/tmp/scanhead-soak-");
    assert_non_null(folder);
    folder[strlen("/tmp/scanhead-soak-XXXXXX")] = '\0';
    assert_int_equal(rmdir(folder), 0);
}

static void all_options(void **state)
{
    (void)state;
    soak_does("c.yaml --client run --client-file f.ply --client-folder new --truth t --duration 2 --reconnect-limit 3 "
              "--client-grace 4 --match-mm 500 --link 2 --allow connects --allow lives --scenario a.yaml",
              0);
    assert_string_equal(trace, "a: run, file f.ply, folder new, truth t, 2 s, 3 s, 4 s, 0.5 m, link 2, allowed 41, 1 "
                               "faults\n");
    assert_int_equal(rmdir("new"), 0);
}

/* Each scenario has its faults and its name, and what is found is added up. */
static void several_scenarios(void **state)
{
    (void)state;
    assert_int_equal(mkdir("there", 0700), 0);
    begin();
    found_in = 1 << 1 | 1 << 3;
    does(&app_soak,
         "c.yaml --client run --client-folder there --scenario a.yaml --scenario b.c.yaml --scenario "
         "./a.yaml --json j.json --junit j.xml --reconnect-limit 2.5",
         1);
    assert_string_equal(trace, "1-a: run, file none, folder there, truth none, 30 s, 2.5 s, 5 s, -0.001 m, link 1, "
                               "allowed 0, 1 faults\n"
                               "2-b.c: run, file none, folder there, truth none, 30 s, 2.5 s, 5 s, -0.001 m, link 1, "
                               "allowed 0, 2 faults\n"
                               "3-a: run, file none, folder there, truth none, 30 s, 2.5 s, 5 s, -0.001 m, link 1, "
                               "allowed 0, 1 faults\n");
    has(on_out, "findings: 2, of 30 checks in 3 scenarios\n");
    assert_string_equal(on_err, "scanhead: soak: the client has findings: 2\n");
    char *json = contents("j.json"), *xml = contents("j.xml");
    has(json, "\"client\": \"run\",\n  \"reconnect_limit_s\": 2.5,\n  \"scenarios\": [\n    {\n      \"scenario\": "
              "\"1-a\",");
    has(json, "\"scenario\": \"2-b.c\"");
    has(json, "\"scenario\": \"3-a\"");
    has(json, "  \"findings\": 2\n}\n");
    has(xml, "<testsuites tests=\"33\" failures=\"2\">");
    free(json);
    free(xml);
    rmdir("there");
}

/* The sheet goes to standard error where standard output has JSON or the truth. */
static void standard_output(void **state)
{
    (void)state;
    soak_does("c.yaml --client run --client-folder new --json -", 0);
    assert_int_equal(on_out[0], '{');
    assert_null(strstr(on_out, "findings: "));
    has(on_err, "findings: 0, of 10 checks in 1 scenario\n");
    soak_does("c.yaml --client run --client-folder new --truth -", 0);
    assert_string_equal(on_out, "");
    has(on_err, "findings: 0, of 10 checks in 1 scenario\n");
    soak_does("c.yaml --client run --client-folder new --json j.json --truth t", 0);
    assert_string_equal(on_err, "");
    has(on_out, "findings: 0, of 10 checks in 1 scenario\n");
    rmdir("new");
}

/* Runs that were judged before are written all the same. */
static void runs_that_fail(void **state)
{
    (void)state;
    for (int stopped = 0; stopped < 2; stopped++) {
        begin();
        fails_at = 2;
        fails_with = stopped ? SH_ESTOPPED : SH_EIO;
        does(&app_soak, "c.yaml --client run --client-folder new --scenario a.yaml --scenario b.c.yaml --json j.json",
             1);
        assert_int_equal(n_runs, 2);
        assert_null(strstr(on_out, "findings: "));
        has(on_err, stopped ? "soak: stopped; of 2 scenarios 1 were judged\n" : "the run failed\n");
        char *json = contents("j.json");
        has(json, "\"scenario\": \"1-a\"");
        assert_null(strstr(json, "2-b.c"));
        free(json);
        remove("j.json");
        begin();
        fails_at = 1;
        fails_with = stopped ? SH_ESTOPPED : SH_EIO;
        does(&app_soak, "c.yaml --client run --client-folder new --json j.json", 1);
        assert_int_equal(access("j.json", F_OK), -1); /* there is nothing to write */
    }
    rmdir("new");
}

/* All scenarios are checked before the first one is run. */
static void wrong_use(void **state)
{
    static const struct {
        const char *words, *error;
    } rows[] = {
        {"c.yaml --set loop.pace=fast",
         "--client: loop.pace is not realtime, and the client has no other time; allowed is "
         "realtime"},
        {"c.yaml --link 6", "--link 6: there is no such link; allowed 1 to 5"},
        {"c.yaml --link 3",
         "--link 3: a client can't be judged on a link of type null; allowed are tcp, pty, udp and usb"},
        {"c.yaml --link 4",
         "--link 4: a client can't be judged on a link of type file; allowed are tcp, pty, udp and usb"},
        {"c.yaml --link 5",
         "--link 5: a client can't be judged on a link of type web; allowed are tcp, pty, udp and usb"},
        {"c.yaml --set links=[]", "c.yaml: links: there are none; needed is one, as in --set 'links=[{type: tcp}]'"},
        {"c.yaml --scenario a.yaml --scenario none.yaml",
         "none.yaml: cannot be opened: No such file or directory; a YAML file is needed"},
        {"c.yaml --client-folder no/folder", "--client-folder no/folder: No such file or directory"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char words[256], expected[256];
        snprintf(words, sizeof words, "%s --client run%s", rows[i].words,
                 strstr(rows[i].words, "folder") == NULL ? " --client-folder new" : "");
        soak_does(words, 2);
        snprintf(expected, sizeof expected, "scanhead: %s\n", rows[i].error);
        assert_string_equal(on_err, expected);
        assert_int_equal(n_runs, 0);
    }
    rmdir("new");
    setenv("TMPDIR", "nowhere", 1);
    soak_does("c.yaml --client run", 1); /* it is the machine's fault */
    setenv("TMPDIR", ".", 1);
    has(on_err, "scanhead: nowhere/scanhead-soak-");
    has(on_err, ": No such file or directory\n");
}

/* The name of a folder may have 400 characters. */
static void long_folders(void **state)
{
    char words[512], name[402];
    (void)state;
    for (int len = 400; len <= 401; len++) {
        memset(name, 'x', sizeof name);
        memset(name, '.', 200); /* a path of the same folder */
        for (int i = 1; i < 200; i += 2)
            name[i] = '/';
        name[len] = '\0';
        snprintf(words, sizeof words, "c.yaml --client run --client-folder %s", name);
        soak_does(words, len == 400 ? 0 : 2);
        if (len == 401) assert_string_equal(on_err, "scanhead: --client-folder: has 401 characters; allowed are 400\n");
        if (len == 400) assert_int_equal(rmdir(name), 0);
    }
}

/* The command line may name no file that a run writes, except for the client's points. */
static void files_of_runs(void **state)
{
    static const struct {
        const char *words;
        int status;
    } rows[] = {{"--client run --json new/configuration.log", 2},
                {"--client run --json new/a.log", 0},
                {"--client run --json new/1-a.log --scenario a.yaml --scenario b.c.yaml", 2},
                {"--client run --json new/2-b.c.log --scenario a.yaml --scenario b.c.yaml", 2},
                {"--client run --json new/configuration.stdout", 0},
                {"--client run --client-file f --json new/configuration.stdout", 0},
                {"--client run --client-file - --json new/configuration.stdout", 2},
                {"--client run --json new/configuration.points", 0},
                {"--client {out} --json new/configuration.points", 2},
                {"--client run>{out} --json new/configuration.points", 2},
                {"--client run --client-file {out} --json new/configuration.points", 2},
                {"--client {out} --client-file new/configuration.points", 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char words[256];
        snprintf(words, sizeof words, "c.yaml --client-folder new %s", rows[i].words);
        soak_does(words, rows[i].status);
        assert_int_equal(n_runs == 0, rows[i].status == 2);
    }
    soak_does("c.yaml --client-folder new --client run --json new/configuration.log", 2);
    has(on_err, "--client-folder");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defaults),        cmocka_unit_test(all_options),    cmocka_unit_test(several_scenarios),
        cmocka_unit_test(standard_output), cmocka_unit_test(runs_that_fail), cmocka_unit_test(wrong_use),
        cmocka_unit_test(long_folders),    cmocka_unit_test(files_of_runs),
    };
    return cmocka_run_group_tests(tests, go_there, commands_end);
}
