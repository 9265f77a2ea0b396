/* SPDX-License-Identifier: MIT */
/* COMMANDS.md beside the table of commands: the commands do what its columns say. */
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"
#include "tests/unit/command_device.h"

static char page[1 << 16];

static int read_page(void **state)
{
    (void)state;
    FILE *f = fopen("drivers/protocol/COMMANDS.md", "r");
    if (f == NULL) return -1;
    page[fread(page, 1, sizeof page - 1, f)] = 0;
    return fclose(f);
}

/* Adds to a text that has room. */
static void __attribute__((format(printf, 2, 3))) add(char text[256], const char *fmt, ...)
{
    va_list ap;
    size_t len = strlen(text);
    va_start(ap, fmt);
    vsnprintf(text + len, 256 - len, fmt, ap);
    va_end(ap);
}

/* The keys of a head profile that fill struct head_limits. */
static const struct {
    size_t at;
    const char *key;
} limits[] = {{offsetof(struct head_limits, prr_min_uhz), "`prr_min_hz`"},
              {offsetof(struct head_limits, prr_max_uhz), "`prr_max_hz`"},
              {offsetof(struct head_limits, lines_min_uhz), "`lines_min_hz`"},
              {offsetof(struct head_limits, lines_max_uhz), "`lines_max_hz`"},
              {offsetof(struct head_limits, pan_max_udeg_s), "`pan_max_deg_s`"},
              {offsetof(struct head_limits, fov_min_udeg), "`fov_min_deg`"},
              {offsetof(struct head_limits, fov_max_udeg), "`fov_max_deg`"},
              {offsetof(struct head_limits, pan_min_udeg), "`pan_min_deg`"},
              {offsetof(struct head_limits, pan_max_udeg), "`pan_max_deg`"},
              {offsetof(struct head_limits, n_stations), "the number of stations"},
              {offsetof(struct head_limits, range_min_nm), "`range_min_m`"},
              {offsetof(struct head_limits, range_max_nm), "`range_max_m`"},
              {offsetof(struct head_limits, near_most_nm), "below each program's reach"},
              {offsetof(struct head_limits, far_least_nm), "above each program's `range_min_m`"},
              {offsetof(struct head_limits, sigma_min_nm), "0 (with a signal model `range_sigma_floor_m`)"},
              {offsetof(struct head_limits, ball_max_nm), "100"}};

static void add_bound(char text[256], const struct command_bound *bound, int decimals)
{
    char number[64];
    command_format_fixed(number, sizeof number, bound->value, decimals);
    for (size_t i = 0; bound->of_profile && i < sizeof limits / sizeof limits[0]; i++)
        if (limits[i].at == (size_t)bound->value) snprintf(number, sizeof number, "%s", limits[i].key);
    add(text, "%s", number);
}

static void add_range(char text[256], const struct command_row *row)
{
    const struct command_setting *s = row->setting;
    for (int i = 0; s->words != NULL && s->words[i] != NULL; i++)
        add(text, "%s%s", i == 0 ? "" : ", ", s->words[i]);
    if (s->words != NULL) return;
    if (s->derived != NULL) {
        add(text, "what the head's rates give");
        return;
    }
    add_bound(text, &s->min, row->unit->decimals);
    add(text, " to ");
    add_bound(text, &s->max, row->unit->decimals);
    if (s->other == NULL) return;
    const int64_t near = s->most == 0 || s->most == -1 ? s->most : s->least;
    add(text, "; %s %s",
        s->most == near ? (near == 0 ? "at most" : "below")
        : near == 0     ? "at least"
                        : "above",
        s->other);
    const int64_t far = s->most == near ? s->least : s->most;
    if (far != COMMAND_UNBOUND) add(text, ", by %lld at most", (long long)llabs(far) / 1000000);
}

static int is_of_faults(const struct command_row *row)
{
    return strncmp(row->header, "FAULt", 5) == 0;
}

static int is_server(const struct command_row *row)
{
    return strcmp(row->header, "TIME:SERVer") == 0;
}

static int is_replay(const struct command_row *row)
{
    return strcmp(row->header, "SCAN:REPLay") == 0;
}

/* Writes a line of the row that is valid by itself. */
static void fill_line(char line[256], const struct command_row *row, int query)
{
    size_t len = strcspn(row->header, "[");
    snprintf(line, 256, "%.*s%s", (int)len, row->header,
             query               ? "?"
             : is_of_faults(row) ? (strstr(row->header, "ADD") != NULL ? " {kind: drop}" : " ALL")
             : is_server(row)    ? " NONE,127.0.0.1,600,0,ETH"
             : is_replay(row)    ? " 1"
             : row->own          ? " 1, DEF"
             : row->setting      ? " DEF"
             : row->unit         ? " 1"
                                 : "");
}

static int refused(const struct command_row *row, enum head_state state, uint32_t control)
{
    struct command_device dev = command_test_device();
    char line[256];
    dev.state = state;
    dev.control = control;
    dev.step_allowed = dev.keeps = 1;
    dev.settings.station = 2; /* so that DEF changes each setting */
    dev.settings.noise = dev.settings.angle_noise = 1;
    dev.settings.range_min_nm = dev.settings.sigma_nm = dev.settings.ball_nm = NANO + 1;
    dev.settings.range_max_nm = 300 * NANO;
    fill_line(line, row, row->act == NULL);
    say(&dev, 1, line);
    return result.error;
}

static void add_states(char text[256], const struct command_row *row)
{
    int n = 0;
    char list[256] = "";
    for (int state = 0; state < HEAD_N_STATES; state++)
        if (refused(row, (enum head_state)state, 0) == 0)
            add(list, "%s%s", n++ == 0 ? "" : ", ", head_state_name((enum head_state)state));
    add(text, "%s", n == HEAD_N_STATES ? "all" : list);
}

/* Writes the columns of a row, up to the words of its last one. */
static void columns(char text[256], const struct command_row *row)
{
    text[0] = 0;
    add(text, "| `%s` | %s | ", row->header, row->query == NULL ? "action" : row->act == NULL ? "query" : "setting");
    if (row->unit != NULL && row->unit->name[0] != 0) add(text, "%s (%s)", row->unit->name, row->unit->suffixes);
    add(text, " | ");
    if (row->own) {
        add(text, is_of_faults(row) ? "see *Faults on request*"
                  : is_server(row)  ? "see *Time server*"
                  : is_replay(row)  ? "see *A recording that is replayed*"
                                    : "see *Moving a station*");
    } else if (row->setting != NULL) {
        add_range(text, row);
    } else if (row->unit != NULL) {
        struct command_device dev = command_test_device();
        char line[256];
        snprintf(line, sizeof line, "%s 1e19", row->header);
        const char *allowed = strstr(say(&dev, 1, line), "allowed ");
        assert_non_null(allowed);
        add(text, "%.*s", (int)strcspn(allowed + 8, "\""), allowed + 8);
    }
    add(text, " | ");
    add_states(text, row);
    add(text, " | %s | ", refused(row, HEAD_IDLE, 2) == CMD_E_PROTECTED ? "yes" : "no");
}

static void each_command_has_its_row(void **state)
{
    (void)state;
    int n = 0, in_page = 0, wrong = 0;
    for (const struct command_row *row = command_rows; row->header != NULL; row++, n++) {
        char text[256];
        columns(text, row);
        const char *at = strstr(page, text);
        int words = at != NULL && at[strlen(text)] != '|' && at[strlen(text)] != '\n';
        if (!words) print_message("# missing, or without words: %s\n", text);
        wrong += !words;
    }
    for (const char *at = page; (at = strstr(at, "\n| `")) != NULL; at++) /* no other table begins so */
        in_page++;
    assert_int_equal(wrong, 0);
    assert_int_equal(in_page, n);
}

/* Each error number that can occur has a row with its text. */
static void each_error_has_its_row(void **state)
{
    (void)state;
    for (int number = -499; number < 1000; number++) {
        const char *text = command_error_text(number);
        char row[256];
        snprintf(row, sizeof row, "\n| %d | %s | ", number, text);
        int generic = strcmp(text, "Command error") == 0 || strcmp(text, "Execution error") == 0 ||
                      strcmp(text, "Query error") == 0 || strcmp(text, "Device-specific error") == 0;
        if (!generic && strstr(page, row) == NULL) fail_msg("missing:%s", row);
    }
}

/* The arrows are `from -event-> to` of every change that a command or the head's own work makes. */
static void the_states_are_the_machines(void **state)
{
    (void)state;
    static const char *const name[HEAD_N_EVENTS] = {[HEAD_EV_BOOTED] = "self test done",
                                                    [HEAD_EV_START] = "SCAN:STARt",
                                                    [HEAD_EV_SPUN_UP] = "mirror at speed",
                                                    [HEAD_EV_STOP] = "SCAN:STOP",
                                                    [HEAD_EV_DONE] = "last frame done",
                                                    [HEAD_EV_SPUN_DOWN] = "mirror at rest",
                                                    [HEAD_EV_RESET] = "*RST"};
    int n = 0, in_page = 0;
    for (int from = HEAD_BOOT; from <= HEAD_FAULT; from++)
        for (int event = 0; event < HEAD_N_EVENTS; event++) {
            int to = head_next_state((enum head_state)from, (enum head_event)event);
            char row[256];
            if (to < 0 || name[event] == NULL) continue;
            snprintf(row, sizeof row, "\n| %s | %s | %s |\n", head_state_name((enum head_state)from), name[event],
                     head_state_name((enum head_state)to));
            if (strstr(page, row) == NULL) fail_msg("missing: %s", row);
            n++;
        }
    const char *at = strstr(page, "\n| from | by | to |\n");
    assert_non_null(at);
    for (at = strchr(strchr(at + 1, '\n') + 1, '\n'); at[1] == '|'; at = strchr(at + 1, '\n'))
        in_page++;
    assert_int_equal(in_page, n);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_command_has_its_row),
        cmocka_unit_test(each_error_has_its_row),
        cmocka_unit_test(the_states_are_the_machines),
    };
    return cmocka_run_group_tests(tests, read_page, NULL);
}
