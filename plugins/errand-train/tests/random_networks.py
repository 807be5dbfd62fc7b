"""Proposal networks of random weights, as learning may meet them in a file."""


def random_network(seed, classes):
    """One whose normalisation has statistics unlike the first ones, and whose scores are not all alike. Needs torch."""
    import torch

    from errand_train.detector.network import DetectorNetwork

    torch.manual_seed(seed)
    network = DetectorNetwork(classes)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.normal_(0.0, 0.1)
            module.running_var.uniform_(0.5, 2.0)
            module.weight.data.uniform_(0.5, 1.5)
            module.bias.data.normal_(0.0, 0.1)
    for head in network.heads:
        head.scores.bias.data.add_(0.1 * torch.randn(classes))
        head.sides.bias.data.add_(0.1 * torch.randn(4))
    return network.eval()
