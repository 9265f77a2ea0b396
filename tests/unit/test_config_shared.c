/* SPDX-License-Identifier: MIT */
/* Files that come with the program are found from the working directory and beside the program: scenarios and head
 * profiles by name, and the names of a folder's files. */
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/reference.h"
#include "firmware_sim/config/shared.h"
#include "tests/unit/config_rig.h"

#include <fcntl.h>
#include <sys/sendfile.h>
#include <sys/wait.h>

static char top[512]; /* where the test began */

/* Makes ./config/faults with two scenarios, a hidden one and a file that is no scenario, and goes there. */
static int go_there(void **state)
{
    if (getcwd(top, sizeof top) == NULL || set_up(state) != 0 || chdir(dir) != 0) return -1;
    if (mkdir("config", 0700) != 0 || mkdir("config/faults", 0700) != 0 || mkdir("empty", 0700) != 0) return -1;
    write_in("config/faults/two.yaml", "faults: [{kind: drop}, {kind: flip}]\n");
    write_in("config/faults/a.yaml", "faults: [{kind: echo}]\n");
    write_in("config/faults/.b.yaml", "faults: []\n");
    write_in("config/faults/c.txt", "");
    return 0;
}

static int go_back(void **state)
{
    static const char *const made[] = {"config/faults/two.yaml",
                                       "config/faults/a.yaml",
                                       "config/faults/.b.yaml",
                                       "config/faults/c.txt",
                                       "config/faults",
                                       "config",
                                       "empty"};
    if (chdir(dir) != 0) return -1;
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++)
        remove(made[i]);
    return chdir(top) != 0 ? -1 : tear_down(state);
}

static void a_yaml_file_has_a_name_before_its_ending(void **state)
{
    (void)state;
    assert_true(cfg_is_yaml("a.yaml") && cfg_is_yaml("b/.yaml") && cfg_is_yaml("a.b.yaml"));
    assert_false(cfg_is_yaml(".yaml") || cfg_is_yaml("ayaml") || cfg_is_yaml("a.yml") || cfg_is_yaml("a.yaml2"));
    assert_false(cfg_is_yaml("") || cfg_is_yaml("a.YAML"));
}

static void names_are_sorted_and_stand_once(void **state)
{
    (void)state;
    char names[64] = "", few[4] = "";
    cfg_name_yaml("config/faults", names, sizeof names);
    assert_string_equal(names, "a, two");
    cfg_name_yaml("config/faults", names, sizeof names);
    assert_string_equal(names, "a, two");
    cfg_name_yaml("nowhere", names, sizeof names);
    assert_string_equal(names, "a, two");
    strcpy(names, "two, x");
    cfg_name_yaml("config/faults", names, sizeof names);
    assert_string_equal(names, "two, x, a");
    cfg_name_yaml("config/faults", few, sizeof few);
    assert_string_equal(few, "a, "); /* as far as they fit */
}

static void a_name_is_found_in_the_folder(void **state)
{
    (void)state;
    char path[CONFIG_PATH_LEN], name[CONFIG_PATH_LEN + 1];
    assert_int_equal(cfg_find_shared("faults/a.yaml", path), 1);
    assert_string_equal(path, "config/faults/a.yaml");
    assert_int_equal(cfg_find_shared("faults", path), 1);
    assert_int_equal(cfg_find_shared("faults/none.yaml", path), 0);
    assert_int_equal(cfg_find_scenario("two", path), 1);
    assert_string_equal(path, "config/faults/two.yaml");
    assert_int_equal(cfg_find_scenario("none", path), 0);
    /* A path is taken as it is, whether there is a file or not. */
    assert_int_equal(cfg_find_scenario("two.yaml", path), 1);
    assert_string_equal(path, "two.yaml");
    assert_int_equal(cfg_find_scenario("x/two", path), 1);
    assert_string_equal(path, "x/two");
    memset(name, 'n', sizeof name);
    name[0] = '/';
    name[CONFIG_PATH_LEN - 1] = '\0';
    assert_int_equal(cfg_find_scenario(name, path), 1);
    assert_string_equal(path, name);
    name[CONFIG_PATH_LEN - 1] = 'n';
    name[CONFIG_PATH_LEN] = '\0';
    assert_int_equal(cfg_find_scenario(name, path), 0);
    assert_int_equal(cfg_find_scenario(name + 1, path), 0); /* too long a name */
}

static void an_unknown_scenario_gets_the_names(void **state)
{
    (void)state;
    char names[64];
    config_name_scenarios(names, sizeof names);
    assert_string_equal(names, "a, two");
    assert_loads(load_text(base));
    assert_int_equal(config_add_scenario(cfg, "tow", &diagnostics), SH_EINPUT);
    assert_string_equal(diagnostics.err[0].text,
                        "tow: no such scenario; allowed the path of a file, or one of these: a, two");
    assert_int_equal(config_add_scenario(cfg, "two", &diagnostics), SH_OK);
    assert_int_equal(cfg->faults.n, 2);
    assert_string_equal(cfg->scenario_file, "config/faults/two.yaml");
    assert_int_equal(chdir("empty"), 0);
    config_name_scenarios(names, sizeof names);
    assert_string_equal(names, "none found");
    assert_int_equal(config_add_scenario(cfg, "two", &diagnostics), SH_EINPUT);
    assert_string_equal(diagnostics.err[0].text,
                        "two: no such scenario; allowed the path of a file, or one of these: none found");
    assert_int_equal(chdir(".."), 0);
}

/* ---- head profiles */

static char heads[512]; /* those that come with the program */

static void copy_profile(const char *to, const char *old, const char *with)
{
    char from[600];
    snprintf(from, sizeof from, "%s/any-rate.yaml", heads);
    char *text = read_source(from), *changed = replaced(text, old, with);
    write_in(to, changed);
    free(text);
    free(changed);
}

/* Three folders have a profile of this name; they are searched in the order that config/heads/README.md gives. */
static void the_first_folder_that_has_a_profile(void **state)
{
    (void)state;
    static struct config_profile profile;
    char all[512], beside[128], mine[128];
    snprintf(heads, sizeof heads, "%s", getenv("SCANHEAD_HEADS"));
    snprintf(beside, sizeof beside, "%s/x.yaml", dir); /* its folder has the folder heads */
    snprintf(mine, sizeof mine, "%s/empty", dir);
    assert_int_equal(mkdir("config/heads", 0700), 0);
    copy_profile("empty/mine.yaml", "model: ", "model: a");
    copy_profile("heads/mine.yaml", "model: ", "model: b");
    copy_profile("config/heads/mine.yaml", "model: ", "model: c");
    copy_profile("config/heads/wrong.yaml", "maker: ", "makers: ");
    static const char models[] = "abc";
    const char *const unlinked[] = {"empty/mine.yaml", "heads/mine.yaml", "config/heads/mine.yaml"};
    setenv("SCANHEAD_HEADS", mine, 1);
    for (int i = 0; i < 3; i++) {
        memset(&err, 0, sizeof err);
        assert_loads(config_load_profile("mine", beside, &profile, &err));
        assert_string_equal(profile.name, "mine");
        assert_int_equal(profile.model[0], models[i]);
        /* Without a configuration, the folder beside it does not count. */
        assert_loads(config_load_profile("mine", NULL, &profile, &err));
        assert_int_equal(profile.model[0], i == 0 ? 'a' : 'c');
        unlink(unlinked[i]);
    }
    assert_int_equal(config_load_profile("mine", beside, &profile, &err), SH_EINPUT);
    assert_string_equal(err.text, "no head profile \"mine\"; allowed wrong");
    assert_int_equal(config_load_profile("wrong", beside, &profile, &err), SH_EINPUT);
    static const char unknown[] =
        "config/heads/wrong.yaml:3: makers: unknown key, did you mean maker? allowed maker, model, ";
    assert_int_equal(strncmp(err.text, unknown, sizeof unknown - 1), 0);
    setenv("SCANHEAD_HEADS", "", 1); /* empty: as if it were not there */
    copy_profile("config/heads/mine.yaml", "model: ", "model: c");
    assert_loads(config_load_profile("mine", beside, &profile, &err));
    snprintf(all, sizeof all, "%s", heads);
    setenv("SCANHEAD_HEADS", all, 1);
}

static void expect_list(const char *where, int want, const char *first)
{
    char *text = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&text, &len);
    const int n = config_list_profiles(where, out, &err);
    fclose(out);
    if (n != want) fail_msg("%d: %s", n, err.text);
    assert_int_equal(strncmp(want < 0 ? err.text : text, first, strlen(first)), 0);
    free(text);
}

/* Only the first folder that can be read is listed. */
static void one_folder_is_listed(void **state)
{
    (void)state;
    char here[128];
    snprintf(here, sizeof here, "%s/empty", dir);
    copy_profile("empty/other.yaml", "model: ", "model: o");
    setenv("SCANHEAD_HEADS", here, 1);
    expect_list(NULL, 1, "other: scanhead oany rate\n");
    expect_list("config/heads", SH_EINPUT, "config/heads/wrong.yaml:3: makers: unknown key");
    unlink("config/heads/wrong.yaml");
    expect_list("config/heads", 1, "mine: scanhead cany rate\n");
    unlink("empty/other.yaml");
    expect_list(NULL, 0, "");
    static struct config_profile profile;
    static const char why[] = "SCANHEAD_HEADS: /nonexistent: No such file or directory; allowed is a folder of head ";
    setenv("SCANHEAD_HEADS", "/nonexistent", 1); /* though config/heads has profiles */
    expect_list(NULL, SH_EINPUT, why);
    assert_int_equal(config_load_profile("mine", NULL, &profile, &err), SH_EINPUT);
    assert_int_equal(strncmp(err.text, why, strlen(why)), 0);
    assert_int_equal(load_edited("any-rate", "mine"), SH_EINPUT);
    assert_says("head.profile: SCANHEAD_HEADS: /nonexistent: No such file or directory; ");
    setenv("SCANHEAD_HEADS", "", 1);
    expect_list(NULL, 1, "mine: scanhead c");
    expect_list("/nonexistent", SH_EINPUT, "/nonexistent: cannot be read; a directory of head profiles is needed");
    assert_int_equal(chdir("empty"), 0);
    expect_list(NULL, SH_EINPUT, "no directory of head profiles found; set SCANHEAD_HEADS");
    assert_int_equal(chdir(".."), 0);
    setenv("SCANHEAD_HEADS", heads, 1);
}

/* ---- beside the program */

static const char *own_name; /* argv[0] */

/* Copies this program to `to`, and runs it there to find a shared file. Returns what it printed; free it. */
static char *find_beside(const char *to, const char *name)
{
    int out[2], status;
    size_t len = 0;
    char *text = NULL;
    const int from = open("/proc/self/exe", O_RDONLY), copy = open(to, O_WRONLY | O_CREAT | O_TRUNC, 0700);
    assert_true(from >= 0 && copy >= 0);
    while (sendfile(copy, from, NULL, 1 << 20) > 0)
        continue;
    close(from);
    close(copy);
    assert_int_equal(pipe(out), 0);
    const pid_t pid = fork();
    if (pid == 0) {
        dup2(out[1], STDOUT_FILENO);
        setenv("TEST_FIND", name, 1);
        execl(to, own_name, (char *)NULL);
        _exit(127);
    }
    close(out[1]);
    FILE *in = fdopen(out[0], "r");
    assert_true(in != NULL && getdelim(&text, &len, '\0', in) > 0);
    fclose(in);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    unlink(to);
    return text;
}

static void expect_beside(const char *name, const char *want)
{
    char program[128], path[256];
    snprintf(program, sizeof program, "%s/bin/program", dir);
    snprintf(path, sizeof path, "%s/bin/%s", dir, want);
    char *text = find_beside(program, name);
    assert_string_equal(text, want[0] == '.' ? path : want);
    free(text);
}

/* An installed program has its files in ../share/scanhead. A program in a build folder has them in ../config. The
 * working directory's folder config comes last. */
static void a_program_finds_what_is_beside_it(void **state)
{
    (void)state;
    assert_int_equal(mkdir("bin", 0700), 0);
    assert_int_equal(mkdir("share", 0700), 0);
    assert_int_equal(mkdir("share/scanhead", 0700), 0);
    assert_int_equal(mkdir("share/scanhead/faults", 0700), 0);
    write_in("share/scanhead/faults/a.yaml", "");
    expect_beside("faults/a.yaml", "../share/scanhead/faults/a.yaml");
    expect_beside("faults/two.yaml", "../config/faults/two.yaml");
    expect_beside("faults/none.yaml", "config/faults/none.yaml: not found");
    unlink("share/scanhead/faults/a.yaml");
    expect_beside("faults/a.yaml", "../config/faults/a.yaml");
    rmdir("share/scanhead/faults");
    rmdir("share/scanhead");
    rmdir("share");
    rmdir("bin");
}

/* As a copy of this program: prints the path of the file. */
static int find_and_print(const char *name)
{
    char path[CONFIG_PATH_LEN];
    const int found = cfg_find_shared(name, path);
    printf("%s%s", path, found ? "" : ": not found");
    return 0;
}

int main(int argc, char **argv)
{
    (void)argc;
    own_name = argv[0];
    if (getenv("TEST_FIND") != NULL) return find_and_print(getenv("TEST_FIND"));
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_yaml_file_has_a_name_before_its_ending),
        cmocka_unit_test(names_are_sorted_and_stand_once),
        cmocka_unit_test(a_name_is_found_in_the_folder),
        cmocka_unit_test(an_unknown_scenario_gets_the_names),
        cmocka_unit_test(the_first_folder_that_has_a_profile),
        cmocka_unit_test(one_folder_is_listed),
        cmocka_unit_test(a_program_finds_what_is_beside_it),
    };
    return cmocka_run_group_tests_name("shared files", tests, go_there, go_back);
}
