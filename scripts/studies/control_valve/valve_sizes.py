"""The datasheet of the rig control_valve for a valve and actuator of another size, with the positioner that it has: the
same nozzle, spool valve and gains of the inner loops. Ratios to the size that ships: bore of the cylinder, stroke and
flow. Pressures of the spring stay, so that forces grow with the area and torques with area and stroke; leaks stay the
same hole. A larger cylinder behind the same ports is slower: time to open and close grows with area times stroke."""

SIZES = {  # bore, stroke, flow
    "dn50": (100 / 160, 0.625, 0.45),
    "dn150": (200 / 160, 1.25, 3.3),
}


def sized(sheet, name):
    bore, stroke, flow = SIZES[name]
    area = bore * bore
    torque = area * stroke
    parameters = {
        "cylinder_area": area,
        "dead_volume": area * stroke,
        "spring_rate": area / stroke,
        "spring_pretension": stroke,
        "actuator_viscous": area / stroke,
        "coulomb_pos_factor": area,
        "coulomb_neg_factor": area,
        "seal_force": area,
        "valve_cv": flow,
    }
    channels = {"flow": flow, "flow_setpoint": flow, "load_torque": torque}
    effects = {  # port -> effect -> parameter -> ratio
        "force.actuator": {"coulomb_friction": {"force": area}},
        "force.valve": {"coulomb_friction": {"force": torque}},
        "transmission.linkage": {"backlash": {"gap": stroke}},
    }
    result = dict(sheet)
    result["parameters"] = [
        {**p, "nominal": p["nominal"] * parameters.get(p["name"], 1)} for p in sheet["parameters"]
    ]
    result["channels"] = [
        {
            **c,
            "range": [v * channels.get(c["name"], 1) for v in c["range"]],
            "noise_std": c["noise_std"] * channels.get(c["name"], 1),
            "resolution": c["resolution"] * channels.get(c["name"], 1),
        }
        for c in sheet["channels"]
    ]
    ratios = {"stroke": stroke, "seal_lever": stroke}
    result["constants"] = {
        n: {**c, "value": c["value"] * ratios.get(n, 1)} for n, c in sheet["constants"].items()
    }
    result["tables"] = {}
    for table, content in sheet["tables"].items():
        columns = dict(content["columns"])
        if table.startswith("coulomb_"):
            columns["x_m"] = [x * stroke for x in columns["x_m"]]
        result["tables"][table] = {**content, "columns": columns}
    loop = dict(sheet["controllers"]["flow"])
    loop.update(
        flow_gain=loop["flow_gain"] / flow,
        flow_integral_gain=loop["flow_integral_gain"] / flow,
        demand_flow=loop["demand_flow"] * flow,
    )
    result["controllers"] = {**sheet["controllers"], "flow": loop}
    result["ports"] = {}
    for port, content in sheet["ports"].items():
        fitting = {}
        for effect, ranges in content["effects"].items():
            by = effects.get(port, {}).get(effect, {})
            fitting[effect] = {
                n: [r[0] * min(1, by.get(n, 1)), r[1] * max(1, by.get(n, 1))] for n, r in ranges.items()
            }
        result["ports"][port] = {**content, "effects": fitting}
        if port == "force.actuator":
            result["ports"][port]["range"] = content["range"] * stroke
    result["faults"] = []
    for fault in sheet["faults"]:
        words = []
        for text in fault["effects"]:
            head, _, rest = text.partition(":")
            effect, _, port = head.partition("@")
            by = effects.get(port, {}).get(effect, {})
            pairs = [word.split("=") for word in rest.split(",")]
            words.append(f"{head}:" + ",".join(f"{n}={float(v) * by.get(n, 1):g}" for n, v in pairs))
        result["faults"].append({**fault, "effects": words})
    return result
