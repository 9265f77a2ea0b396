/* SPDX-License-Identifier: MIT */
#include "tests/wire/fault_head.h"

const struct room_config FAULT_ROOM = {.profile = "any-rate",
                                       .prr_hz = 100000,
                                       .lines_hz = 100,
                                       .pan_deg_s = 100,
                                       .pan_stop_deg = 30,
                                       .frames = 1,
                                       .links = LINK_YAML_BOTH,
                                       .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

struct head fault_head_start(struct wire *wire, const struct room_config *c, const char *faults,
                             const char *const *more)
{
    static char scenario[352], truth[352], config[352];
    const char *args[24] = {"--scenario", scenario, "--truth", truth};
    int n = faults != NULL ? 4 : 2;
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, c));
    if (faults != NULL) snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, "faults.yaml", faults));
    unlink(wire_path(wire, "truth.json"));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    if (faults == NULL) memcpy(args, args + 2, 2 * sizeof args[0]);
    while (more != NULL && *more != NULL)
        args[n++] = *more++;
    args[n] = NULL;
    return head_start(wire, config, args);
}

void fault_head_add(struct scanhead *sh, const char *fault, const char *number)
{
    char line[256];
    snprintf(line, sizeof line, "FAUL:ADD %s", fault);
    assert_string_equal(client_ask(sh, line), number);
}
