/* SPDX-License-Identifier: MIT */
/* The process of somebody else's client: placeholders of its command, its end, and what it leaves running. */
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>

#include "firmware_sim/app/studio/verdict/client.h"
#include "tests/unit/scene_files.h"

static int drop(void **state)
{
    unlink(path_in("log"));
    return remove_folder(state);
}

static void test_placeholders(void **state)
{
    (void)state;
    static const struct {
        const char *endpoint, *text, *filled;
    } cases[] = {
        {"tcp:127.0.0.1:40123", "c {endpoint} {host} {port}", "c tcp:127.0.0.1:40123 127.0.0.1 40123"},
        {"tcp:[::1]:5", "{host}/{port}/{path}.", "::1/5/."},
        {"udp:127.0.0.1:2368", "{port}{port}", "23682368"},
        {"tty:/dev/pts/3", "{path} {host}{port} {endpoint}", "/dev/pts/3  tty:/dev/pts/3"},
        {"tcp:h:1", "awk '{print}' {out}.ply {} {ports", "awk '{print}' /o.ply {} {ports"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct client_words words = {cases[i].endpoint, "/o"};
        char *filled = client_fill(cases[i].text, &words);
        assert_string_equal(filled, cases[i].filled);
        free(filled);
    }
}

static void begin(struct client *client, const char *line)
{
    struct sh_err err;
    if (client_start(client, line, path_in("log"), NULL, &err) != SH_OK) fail_msg("%s", err.text);
}

static void test_ends(void **state)
{
    (void)state;
    struct client client;
    begin(&client, "exit 3"); /* by itself */
    while (!client_has_ended(&client))
        usleep(1000);
    client_end(&client, 0.0);
    assert_true(WIFEXITED(client.status) && WEXITSTATUS(client.status) == 3 && !client.had_to_be_killed);
    begin(&client, "exec sleep 600");
    assert_false(client_has_ended(&client));
    client_end(&client, 60.0);
    assert_true(client_has_ended(&client) && !client.had_to_be_killed);
    assert_true(WIFSIGNALED(client.status) && WTERMSIG(client.status) == SIGTERM);
}

/* Waits until the log begins with this line. */
static void wait_for(const char *line)
{
    char text[16] = "";
    while (strcmp(text, line) != 0) {
        FILE *file = fopen(path_in("log"), "r");
        assert_non_null(file);
        if (fgets(text, sizeof text, file) == NULL) text[0] = '\0';
        fclose(file);
    }
}

static pid_t wait_for_number(void)
{
    int number = 0;
    char end = 0;
    while (end != '\n') {
        FILE *file = fopen(path_in("log"), "r");
        assert_non_null(file);
        if (fscanf(file, "%d%c", &number, &end) != 2) end = 0;
        fclose(file);
    }
    return number;
}

/* The loop is in the group that the shell leaves behind, and does not end at SIGTERM. The whole group is waited for,
 * and killed. The loop's shell says when the trap is set: a signal before that would end it. */
static void test_what_the_shell_leaves(void **state)
{
    (void)state;
    struct client client;
    begin(&client, "(trap '' TERM; echo set; while :; do sleep 600; done) & exit 0");
    wait_for("set\n");
    assert_false(client_has_ended(&client));
    client_end(&client, 0.2);
    assert_true(client.had_to_be_killed && client_has_ended(&client));
    assert_int_equal(kill(-client.pid, 0), -1);
}

/* Some programs leave the group, with their own session or as timeout does. Then each prints its process number. */
static void test_what_leaves_the_group(void **state)
{
    (void)state;
    static const char *const lines[] = {
        "setsid sh -c 'echo $$; exec sleep 600' & wait", "timeout 600 sh -c 'echo $$; exec sleep 600'; true",
        "(setsid sh -c 'echo $$; exec sleep 600' &) ; exit 0", /* its parent ends, and our process takes its place */
    };
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        struct client client;
        begin(&client, lines[i]);
        const pid_t pid = wait_for_number();
        assert_false(client_has_ended(&client));
        client_end(&client, 60.0);
        assert_false(client.had_to_be_killed);
        assert_int_equal(kill(pid, 0), -1);
    }
    struct client client;
    begin(&client, "setsid sh -c 'trap \"\" TERM; echo $$; while :; do sleep 600; done' & wait");
    const pid_t pid = wait_for_number();
    client_end(&client, 0.2);
    assert_true(client.had_to_be_killed);
    assert_int_equal(kill(pid, 0), -1);
}

/* Without a log there is no client, and its end touches no descriptor of this process. */
static void test_no_log(void **state)
{
    (void)state;
    struct client client;
    struct sh_err err;
    assert_int_not_equal(client_start(&client, "exit 3", "/nowhere/log", NULL, &err), SH_OK);
    assert_true(client.pid == 0 && client.in_fd == -1 && client_has_ended(&client));
    client_end(&client, 0.0);
    assert_int_not_equal(fcntl(1, F_GETFD), -1);
}

/* Some programs end with their input, or at a key. If its input ended, this client would end with status 5. */
static void test_its_input_stays_open(void **state)
{
    (void)state;
    struct client client;
    begin(&client, "echo open; cat; exit 5");
    wait_for("open\n");
    client_end(&client, 60.0);
    assert_true(WIFSIGNALED(client.status));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_placeholders),          cmocka_unit_test(test_ends),
        cmocka_unit_test(test_what_the_shell_leaves), cmocka_unit_test(test_what_leaves_the_group),
        cmocka_unit_test(test_its_input_stays_open),  cmocka_unit_test(test_no_log),
    };
    return cmocka_run_group_tests(tests, make_folder, drop);
}
