/* SPDX-License-Identifier: MIT */
/* Headers of commands: long and short forms, in any case and from the root, and nothing between or beyond them. HELP?
 * lists them all. */
#include "drivers/protocol/native.h"
#include "tests/unit/command_device.h"

/* Long and short forms, written out by hand from the set's description. */
static const struct {
    const char *full, *brief;
    int query, set; /* which forms there are */
    const char *value;
} commands[] = {
    {"*IDN", "*IDN", 1, 0, ""},
    {"*RST", "*RST", 0, 1, ""},
    {"*CLS", "*CLS", 0, 1, ""},
    {"*OPC", "*OPC", 1, 0, ""},
    {"*STB", "*STB", 1, 0, ""},
    {"SYSTEM:ERROR:NEXT", "SYST:ERR", 1, 0, ""},
    {"SYSTEM:ERROR:COUNT", "SYST:ERR:COUN", 1, 0, ""},
    {"SYSTEM:LOST", "SYST:LOST", 1, 0, ""},
    {"SYSTEM:VERSION", "SYST:VERS", 1, 0, ""},
    {"SYSTEM:CONTROL", "SYST:CONT", 1, 0, ""},
    {"SYSTEM:PLAN", "SYST:PLAN", 1, 0, ""},
    {"SYSTEM:CONTROL:WHO", "SYST:CONT:WHO", 1, 0, ""},
    {"SYSTEM:CONTROL:TAKE", "SYST:CONT:TAKE", 0, 1, ""},
    {"SYSTEM:CONTROL:RELEASE", "SYST:CONT:REL", 0, 1, ""},
    {"SYSTEM:SESSION", "SYST:SESS", 1, 0, ""},
    {"HEAD:PRR", "HEAD:PRR", 1, 1, " 200000"},
    {"HEAD:LINES", "HEAD:LIN", 1, 1, " 50"},
    {"HEAD:PAN", "HEAD:PAN", 1, 1, " 9"},
    {"HEAD:STATE", "HEAD:STAT", 1, 0, ""},
    {"HEAD:REBOOT", "HEAD:REB", 0, 1, ""},
    {"HEAD:STORE", "HEAD:STOR", 0, 1, ""},
    {"HEAD:STATION", "HEAD:STATION", 1, 1, " 2"},
    {"HEAD:RANGE:MIN", "HEAD:RANG:MIN", 1, 1, " 2"},
    {"HEAD:RANGE:MAX", "HEAD:RANG:MAX", 1, 1, " 20"},
    {"HEAD:NOISE", "HEAD:NOIS", 1, 1, " ON"},
    {"HEAD:NOISE:ANGLE", "HEAD:NOIS:ANGL", 1, 1, " ON"},
    {"HEAD:NOISE:SIGMA", "HEAD:NOIS:SIGM", 1, 1, " 0.01"},
    {"HEAD:NOISE:BALL", "HEAD:NOIS:BALL", 1, 1, " 0.1"},
    {"HEAD:PHASE", "HEAD:PHAS", 1, 1, " 90"},
    {"HEAD:PHASE:LOCK", "HEAD:PHAS:LOCK", 1, 1, " OFF"},
    {"HEAD:PHASE:EDGE", "HEAD:PHAS:EDGE", 1, 0, ""},
    {"SCAN:STEP", "SCAN:STEP", 1, 1, " 0.1"},
    {"SCAN:STEP:LINE", "SCAN:STEP:LINE", 1, 1, " 0.1"},
    {"SCAN:STEP:PAN", "SCAN:STEP:PAN", 1, 1, " 0.1"},
    {"SCAN:LINE:START", "SCAN:LINE:STAR", 1, 1, " -20"},
    {"SCAN:LINE:STOP", "SCAN:LINE:STOP", 1, 1, " 20"},
    {"SCAN:PAN:START", "SCAN:PAN:STAR", 1, 1, " 10"},
    {"SCAN:PAN:STOP", "SCAN:PAN:STOP", 1, 1, " 90"},
    {"SCAN:FRAMES", "SCAN:FRAM", 1, 1, " 4"},
    {"SCAN:ECHOES", "SCAN:ECH", 1, 1, " LAST"},
    {"SCAN:START", "SCAN:STAR", 0, 1, ""},
    {"SCAN:STOP", "SCAN:STOP", 0, 1, ""},
    {"SCAN:COUNT", "SCAN:COUN", 1, 0, ""},
    {"SCAN:WAVEFORM", "SCAN:WAV", 1, 1, " OFF"},
    {"SCAN:REPLAY", "SCAN:REPL", 1, 1, " 2"},
    {"SITE:POSE", "SITE:POSE", 1, 1, " 1, DEF"},
    {"HELP", "HELP", 1, 0, ""},
    {"HELP:SETTINGS", "HELP:SET", 1, 0, ""},
    {"TIME", "TIME", 1, 0, ""},
    {"TIME:UTC", "TIME:UTC", 1, 0, ""},
    {"TIME:GPS", "TIME:GPS", 1, 0, ""},
    {"TIME:PTP", "TIME:PTP", 1, 0, ""},
    {"TIME:STEP", "TIME:STEP", 0, 1, " 5"},
    {"TIME:SHIFT", "TIME:SHIF", 1, 1, " 5"},
    {"TIME:SERVER", "TIME:SERV", 1, 1, " NONE,127.0.0.1,5,0,ETH"},
    {"FAULT:ADD", "FAUL:ADD", 0, 1, " {kind: drop}"},
    {"FAULT:CLEAR", "FAUL:CLE", 0, 1, " ALL"},
    {"FAULT:LIST", "FAUL:LIST", 1, 0, ""},
    {"FAULT:INJECTED", "FAUL:INJ", 1, 0, ""},
};

static struct command_device device_for(const char *header)
{
    struct command_device dev = command_test_device();
    dev.step_allowed = dev.keeps = 1;
    if (strcmp(header, "SCAN:STOP") == 0) dev.state = HEAD_SCANNING;
    return dev;
}

static void try_forms(size_t i, const char *header, int good)
{
    static const char *const lead[] = {"", ":", "  ", "\t :"};
    char line[COMMAND_MAX_LINE];
    for (size_t k = 0; k < N_OF(lead); k++) {
        const int colon = strchr(lead[k], ':') != NULL && header[0] == '*'; /* common commands have no root */
        for (int query = 0; query < 2; query++) {
            struct command_device dev = device_for(commands[i].full);
            const char *asks = strcmp(commands[i].full, "SITE:POSE") == 0 ? " 1" : "";
            snprintf(line, sizeof line, "%s%s%s%s ", lead[k], header, query ? "?" : "",
                     query ? asks : commands[i].value);
            say(&dev, 1, line);
            const int expected = good && !colon && (query ? commands[i].query : commands[i].set);
            if ((result.error == 0) != expected) fail_msg("'%s' gives '%s'", line, result.reply);
            assert_true(result.reply[0] != '\0');
        }
    }
}

static void long_and_short_forms_in_any_case(void **ctx)
{
    (void)ctx;
    for (size_t i = 0; i < N_OF(commands); i++) {
        char mixed[64];
        snprintf(mixed, sizeof mixed, "%s", commands[i].full);
        for (size_t k = 0; mixed[k] != '\0'; k += 2)
            if (mixed[k] >= 'A' && mixed[k] <= 'Z') mixed[k] = (char)(mixed[k] + 32);
        try_forms(i, commands[i].full, 1);
        try_forms(i, commands[i].brief, 1);
        try_forms(i, mixed, 1);
    }
}

/* Copies the k-th word of a header; 0 when it has fewer. */
static int word_of(const char *header, int k, char word[32])
{
    for (; k > 0; k--) {
        header = strchr(header, ':');
        if (header == NULL) return 0;
        header++;
    }
    snprintf(word, 32, "%.*s", (int)strcspn(header, ":"), header);
    return 1;
}

/* Returns whether each word is in its long or short form. */
static int is_form_of(const char *header, const char *full, const char *brief)
{
    char got[32], word[32];
    int k = 0;
    for (; word_of(header, k, got); k++) {
        if (word_of(full, k, word) && strcmp(got, word) == 0) continue;
        if (word_of(brief, k, word) && strcmp(got, word) == 0) continue;
        return 0;
    }
    return !word_of(full, k, word);
}

static int is_command(const char *header)
{
    for (size_t i = 0; i < N_OF(commands); i++)
        if (is_form_of(header, commands[i].full, commands[i].brief)) return 1;
    return is_form_of(header, "SYSTEM:ERROR", "SYST:ERR"); /* [:NEXT] */
}

static void nothing_between_or_beyond_the_forms(void **ctx)
{
    (void)ctx;
    for (size_t i = 0; i < N_OF(commands); i++) {
        char cut[64];
        for (size_t len = strlen(commands[i].full) - 1; len > 1; len--) {
            snprintf(cut, sizeof cut, "%.*s", (int)len, commands[i].full);
            if (!is_command(cut)) try_forms(i, cut, 0);
        }
        snprintf(cut, sizeof cut, "%sX", commands[i].full);
        try_forms(i, cut, 0);
        snprintf(cut, sizeof cut, "%s:", commands[i].full);
        try_forms(i, cut, 0);
        snprintf(cut, sizeof cut, "X:%s", commands[i].full);
        try_forms(i, cut, 0);
    }
}

/* Counts the headers of a reply; each must be a command. */
static size_t count_headers(struct command_device *dev, const char *line)
{
    say(dev, 1, line);
    assert_true(strlen(result.reply) < COMMAND_MAX_REPLY - 1); /* not cut */
    assert_true(strlen(result.reply) + 2 < NATIVE_MAX_TEXT);   /* and fits the wire with CR LF */
    char copy[COMMAND_MAX_REPLY], *save = NULL;
    snprintf(copy, sizeof copy, "%s", result.reply);
    size_t n = 0;
    for (char *word = strtok_r(copy, " ", &save); word != NULL; word = strtok_r(NULL, " ", &save), n++) {
        char plain[64] = "";
        for (const char *p = word; *p != '\0'; p++)
            if (strchr("[]?", *p) == NULL) plain[strlen(plain)] = *p >= 'a' ? (char)(*p - 32) : *p;
        if (!is_command(plain)) fail_msg("%s lists '%s'", line, word);
    }
    return n;
}

/* HELP:SETtings? lists the settings, and HELP? all others. */
static void help_lists_every_header_in_two_lines(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    assert_int_equal(count_headers(&dev, "HELP?") + count_headers(&dev, "HELP:SET?"), N_OF(commands));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(long_and_short_forms_in_any_case),
        cmocka_unit_test(nothing_between_or_beyond_the_forms),
        cmocka_unit_test(help_lists_every_header_in_two_lines),
    };
    return cmocka_run_group_tests_name("command forms", tests, NULL, NULL);
}
