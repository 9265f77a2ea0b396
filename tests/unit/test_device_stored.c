/* SPDX-License-Identifier: MIT */
/* Settings that the head keeps without power: HEAD:STORe, power cycles, *RST, a new start, a replayed journal. */
#include "tests/unit/device_rig.h"

#include <math.h>

#include "firmware_sim/config/config.h"

static char settings_path[96];

static struct settings_file *open_settings(void)
{
    struct settings_file *file;
    struct sh_err err;
    need(settings_file_open(settings_path, "head", NULL, &file, &err), &err);
    return file;
}

static void close_settings(struct settings_file *file)
{
    struct sh_err err;
    need(settings_file_close(file, &err), &err);
}

static void expect(struct rig *rig, const char *query, const char *reply)
{
    if (strcmp(rig_tell(rig, query, rig->next), reply) != 0)
        fail_msg("%s: %s, not %s", query, rig_tell(rig, query, rig->next), reply);
}

static void reboot(struct rig *rig)
{
    rig_tell(rig, "HEAD:REBOOT", rig->next);
    const uint64_t ons = device_last_power(rig->device, INT64_MAX).ons;
    for (int i = 0; i < 1000 && device_last_power(rig->device, INT64_MAX).ons == ons; i++)
        assert_true(rig_claim(rig));
    assert_true(device_last_power(rig->device, INT64_MAX).ons == ons + 1);
    rig_go_to(rig, rig->next + 300); /* boot_s is 0.2 s; a reply of a tick before power went would be empty */
}

static void what_is_stored_is_that_of_power_up(void **state)
{
    (void)state;
    unlink(settings_path);
    struct settings_file *file = open_settings();
    struct rig *rig = rig_open(&(struct device_options){.settings = file}, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "HEAD:LINES 40", 290);
    rig_tell(rig, "SCAN:ECHOES LAST", 290);
    rig_tell(rig, "HEAD:STATION 2", 290);
    rig_tell(rig, "HEAD:STORE", 290);
    rig_tell(rig, "HEAD:LINES 50", 290);
    rig_tell(rig, "*RST", 290);
    expect(rig, "HEAD:LINES?", "40");
    expect(rig, "HEAD:STATION?", "1"); /* the station is no setting of the head */
    rig_tell(rig, "HEAD:LINES 50", 290);
    reboot(rig);
    expect(rig, "HEAD:LINES?", "40");
    expect(rig, "HEAD:LINES? DEF", "40");
    expect(rig, "SCAN:ECHOES?", "LAST");
    rig_close(rig);
    close_settings(file);

    file = open_settings();
    char text[SETTINGS_FILE_TEXT];
    settings_file_get(file, "head", text); /* only values that differ from the configuration's */
    assert_string_equal(text, "HEAD:LINes 40\nSCAN:ECHoes LAST\n");
    rig = rig_open(&(struct device_options){.settings = file}, NULL, 0);
    rig_go_to(rig, 300);
    expect(rig, "HEAD:LINES?", "40");
    expect(rig, "SCAN:ECHOES? DEF", "LAST");
    rig_tell(rig, "HEAD:LINES 100", 290); /* as configured: it need not be stored */
    rig_tell(rig, "SCAN:ECHOES ALL", 290);
    rig_tell(rig, "HEAD:STORE", 290);
    settings_file_get(file, "head", text);
    assert_string_equal(text, "");
    rig_close(rig);
    close_settings(file);
}

static void without_a_file_nothing_is_stored(void **state)
{
    (void)state;
    struct command_result result;
    char text[SETTINGS_FILE_TEXT];
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "HEAD:LINES 40", 290);
    device_command(rig->device, 1, "HEAD:STORE", 290, &result);
    assert_int_equal(result.error, CMD_E_SETTINGS);
    assert_non_null(strstr(result.reply, "needs head.settings_file"));
    assert_int_equal(device_store(rig->device, "cola", "a\n"), 1);
    assert_int_equal(device_stored(rig->device, "cola", text), 1);
    reboot(rig);
    expect(rig, "HEAD:LINES?", "100");
    rig_close(rig);
}

/* A protocol's own settings are there for its next session, and the head's stay beside them. */
static void a_protocol_has_its_own(void **state)
{
    (void)state;
    char text[SETTINGS_FILE_TEXT];
    unlink(settings_path);
    struct settings_file *file = open_settings();
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 40\n"), SH_OK);
    struct rig *rig = rig_open(&(struct device_options){.settings = file}, NULL, 0);
    assert_int_equal(device_stored(rig->device, "cola", text), 0);
    assert_string_equal(text, "");
    assert_int_equal(device_store(rig->device, "cola", "name=gate\n"), 0);
    assert_int_equal(device_store(rig->device, "cola", "no end"), 1);
    assert_int_equal(device_stored(rig->device, "cola", text), 0);
    assert_string_equal(text, "name=gate\n");
    rig_close(rig);
    close_settings(file);
    file = open_settings();
    settings_file_get(file, "head", text);
    assert_string_equal(text, "HEAD:LINes 40\n");
    settings_file_get(file, "cola", text);
    assert_string_equal(text, "name=gate\n");
    close_settings(file);
}

/* Taken in the file's order, some settings contradict the configured ones: 50 to 10 degrees is no line, and 1500 lines
 * a second need more than 1000 pulses. */
static void limits_that_depend_on_each_other_are_no_matter(void **state)
{
    (void)state;
    unlink(settings_path);
    struct settings_file *file = open_settings();
    assert_int_equal(settings_file_put(file, "head",
                                       "SCAN:LINE:STARt 50\nSCAN:LINE:STOP 55\nHEAD:PRR 1000\nHEAD:LINes 900\n"
                                       "SCAN:PAN:STARt 200\nSCAN:PAN:STOP 300\n"),
                     SH_OK);
    struct rig *rig =
        rig_open(&(struct device_options){.settings = file},
                 (const char *const[]){"head.line_stop_deg=10", "head.prr_hz=2000", "head.lines_hz=1500"}, 3);
    expect(rig, "SCAN:LINE:START?", "50");
    expect(rig, "SCAN:LINE:STOP?", "55");
    expect(rig, "HEAD:PRR?", "1000");
    expect(rig, "HEAD:LINES?", "900");
    expect(rig, "SCAN:PAN:START?", "200");
    expect(rig, "SYST:ERR:COUNT?", "0"); /* tries leave nothing in the queue */
    rig_close(rig);
    close_settings(file);
}

static void expect_refused(const char *text, const char *says)
{
    static const char *const fast[] = {"loop.pace=fast"};
    struct sh_err err = {0};
    struct device *device;
    struct rig *rig = rig_open(NULL, fast, 1); /* for its site */
    struct settings_file *file = open_settings();
    assert_int_equal(settings_file_put(file, "head", text), SH_OK);
    const int rc = device_create(rig->site, &(struct device_options){.settings = file}, &device, &err);
    if (rc != SH_EINPUT || strstr(err.text, says) == NULL || strstr(err.text, settings_path) == NULL)
        fail_msg("%s: %d, %s", text, rc, err.text);
    close_settings(file);
    rig_close(rig);
}

static void what_the_head_does_not_take_is_refused(void **state)
{
    (void)state;
    unlink(settings_path);
    expect_refused("HEAD:LINes 5000\n", "'HEAD:LINes 5000' is refused: ERR -222");
    expect_refused("HEAD:LINes\n", "'HEAD:LINes' is refused: ERR -109");
    expect_refused("SCAN:STARt\n", "'SCAN:STARt' is no setting that this head stores");
    expect_refused("HEAD:STATION 2\n", "'HEAD:STATION 2' is no setting that this head stores");
    expect_refused("HEAD:REBoot\n", "is no setting that this head stores");
    expect_refused("TIME:SERVer CLIENT,127.0.0.1,600,0,ETH\n", "allowed with loop.pace realtime");
    expect_refused("NOTHING 1\n", "is no setting that this head stores");
}

enum { TICKS = 700 };

/* Returns the work of each tick of a run whose scan begins by itself; free() it. */
static struct device_work *run(const struct device_options *options)
{
    struct device_work *works = calloc(TICKS, sizeof *works);
    assert_non_null(works);
    struct rig *rig = rig_open(options, NULL, 0);
    while (rig->next < TICKS) {
        if (options->replay == NULL && rig->next == 500) rig_tell(rig, "HEAD:LINES 70", 490);
        if (options->replay == NULL && rig->next == 520) rig_tell(rig, "HEAD:STORE", 510);
        assert_true(rig_claim(rig));
        works[rig->work.tick] = rig->work;
    }
    expect(rig, "HEAD:LINES? DEF", "70");
    rig_close(rig);
    return works;
}

/* A journal begins with the stored settings as commands, so the replay needs no file. */
static void a_replayed_journal_needs_no_file(void **state)
{
    (void)state;
    unlink(settings_path);
    struct settings_file *file = open_settings();
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 40\n"), SH_OK);
    struct device_work *once = run(&(struct device_options){.settings = file, .journal = journal_path, .start = 1});
    close_settings(file);
    struct device_work *again = run(&(struct device_options){.replay = journal_path, .start = 1});
    int described = 0;
    for (int i = 0; i < TICKS; i++) {
        const struct device_work *a = &once[i], *b = &again[i];
        assert_true(a->scanning == b->scanning && a->pulse0 == b->pulse0 && a->pulse_end == b->pulse_end);
        assert_int_equal(a->describe, b->describe);
        if (!a->describe) continue;
        described++;
        assert_memory_equal(&a->descriptor, &b->descriptor, sizeof a->descriptor);
        assert_true(a->descriptor.lines_uhz == (i < 500 ? 40000000u : 70000000u));
    }
    assert_true(described >= 2); /* before the scan, and with its start */
    free(once);
    free(again);
}

/* Before the first scan the descriptor has the settings of power-up, also where a command has just stored them. A range
 * needs a site that is planned for it. */
static void readers_before_a_scan_are_told_them(void **state)
{
    (void)state;
    unlink(settings_path);
    struct settings_file *file = open_settings();
    assert_int_equal(settings_file_put(file, "head", "HEAD:LINes 40\nHEAD:RANGe:MAX 5.5\n"), SH_OK);
    for (int replay = 0; replay < 2; replay++) {
        struct device_options options = {.journal = journal_path};
        if (replay) options = (struct device_options){.replay = journal_path};
        if (!replay) options.settings = file;
        struct rig *rig = rig_open(&options, NULL, 0);
        rig_go_to(rig, 1001); /* it is repeated each second */
        assert_true(rig->work.describe && rig->work.descriptor.lines_uhz == 40000000);
        assert_true(fabs(rig->work.descriptor.range_max_m - 5.5) < 1e-9); /* ranges are whole nm */
        if (!replay) rig_tell(rig, "HEAD:LINES 70", 1000);
        if (!replay) rig_tell(rig, "HEAD:RANG:MAX 6.5", 1000);
        if (!replay) rig_tell(rig, "HEAD:STORE", 1000);
        rig_go_to(rig, 2001);
        assert_true(rig->work.describe && rig->work.descriptor.lines_uhz == 70000000);
        assert_true(fabs(rig->work.descriptor.range_max_m - 6.5) < 1e-9);
        rig_close(rig);
    }
    close_settings(file);
}

static int make_all(void **state)
{
    const int rc = make_folder(state);
    snprintf(settings_path, sizeof settings_path, "%s/settings", folder);
    return rc;
}

static int remove_all(void **state)
{
    unlink(settings_path);
    return remove_folder(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_stored_is_that_of_power_up),
        cmocka_unit_test(without_a_file_nothing_is_stored),
        cmocka_unit_test(a_protocol_has_its_own),
        cmocka_unit_test(limits_that_depend_on_each_other_are_no_matter),
        cmocka_unit_test(what_the_head_does_not_take_is_refused),
        cmocka_unit_test(a_replayed_journal_needs_no_file),
        cmocka_unit_test(readers_before_a_scan_are_told_them),
    };
    return cmocka_run_group_tests(tests, make_all, remove_all);
}
